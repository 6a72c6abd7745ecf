"""The hopper against LIGGGHTS

The centre design in full size, five fillings, in this solver and in LIGGGHTS 3.8, a code of other authors
whose walls are triangles. Each pair of runs starts from the very same falling column (positions, velocities
and diameters), the gate opens after the same time, and both use the rolling friction that LIGGGHTS has
(`cdt`). LIGGGHTS runs at 2e-5 s, this solver at the study's 4e-5 s.

A bed forgets the details of its start within milliseconds, so if the codes agree their runs are samples of
one distribution, and only means over the seeds can be compared. With n seeds and the variance s^2 over them,
the means then differ by (s_1^2 + s_2^2) / n, in the mean square, in each of the 21 windows of M. The rows
divide the root mean square over M of the difference by the root of the mean over M of that: chance gives
about 1, and 1.5 is the limit.

`edem`, the study's own rolling friction, stands beside it: what the model changes, not the code. LIGGGHTS
takes two to four minutes a seed; its runs are kept.
"""

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from hopperopt import config, design, geometry, liggghts, monitors
from hopperopt.outflow import GRID, outflow
from validation import liggghts_runs
from validation.kept import kept
from validation.report import Row, at_most, within

SEEDS = 5
FILLING = 0.44  # s until the gate opens, in both codes: 0.04 s longer than this bed takes to rest
DISCHARGE = 2.0  # s, at most
PEER_STEP = 2.0e-5  # s; at the study's step LIGGGHTS loses spheres
SOLVERS = {"LIGGGHTS, cdt": "cdt", "this solver, cdt": "cdt", "this solver, edem": "edem"}
COLOURS = dict(zip(SOLVERS, ("#0072B2", "#D55E00", "#8C8C8C"), strict=True))


def case(seed, rolling):
    """The centre design's case, with a filling of its own for each seed."""
    root = Path(__file__).resolve().parent.parent
    study = config.parse(config.load([root / "config.yaml"]), root)
    out = study.simulation_case(design.centre(study.levels), "validation", seed)
    out["contact"]["rolling"] = rolling
    return out


def peer_deck(scene, sensor):
    """LIGGGHTS' input for a whole run."""
    files = scene.deck(PEER_STEP, sensor)
    files["in.start"] += (
        f"run {round(FILLING / PEER_STEP)}\n{liggghts.look('opening.txt')}{scene.opening()}"
        f"run {round(DISCHARGE / PEER_STEP)}\n"
    )
    return files


def read_peer(folder, log):
    """The arrays that are kept of LIGGGHTS' run."""
    exit_time, diameter = liggghts_runs.outflow_file(folder / "outflow.txt")
    position, radius = liggghts_runs.look_file(folder / "opening.txt")
    return {
        "exit_time": exit_time,
        "diameter": diameter,
        "position": position.astype(np.float32),
        "radius": radius,
        "thermo": liggghts_runs.thermo(log),
    }


def peer_run(seed):
    """LIGGGHTS' run of a seed."""
    setting = case(seed, "cdt")
    files = peer_deck(liggghts.Scene.of_case(setting), setting["discharge"]["sensor"])
    return liggghts_runs.kept_run("liggghts-hopper", files, read_peer)


def own_run(seed, rolling):
    """This solver's run of a seed, with the gate opened at the same time."""
    setting = case(seed, rolling)

    def make():
        scene = liggghts.Scene.of_case(setting)
        simulation = liggghts_runs.simulation(scene, setting["time_step"])
        simulation.advance(round(FILLING / setting["time_step"]))
        position = simulation.by_identity(simulation.spheres.position)
        simulation.open("gate", setting["discharge"]["sensor"])
        while simulation.count and simulation.time < DISCHARGE:
            simulation.advance(250)
        return {
            "exit_time": simulation.exit_time,
            "diameter": 2.0 * scene.radius,
            "position": position.astype(np.float32),
            "radius": scene.radius,
        }

    return kept("hopper", [setting, FILLING, DISCHARGE], make)


def bed(run, setting):
    """Height of the bed's top (m), of its centre of mass (m), and its solid fraction, at the opening."""
    position, radius = run["position"].astype(float), run["radius"]
    pairs = cKDTree(position).query_pairs(2.0 * radius.max(), output_type="ndarray")
    gap = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1) - radius[pairs].sum(axis=1)
    contacts = np.bincount(pairs[gap < 0.0].ravel(), minlength=len(radius))  # a sphere in flight has none
    level = monitors.filling_level(position, radius, contacts, setting)
    hopper, insert = (np.array(setting["walls"][name]) for name in ("hopper", "insert"))
    room = geometry.volume_inside(hopper, level) - geometry.solid_volume(insert, level)
    solid = 4.0 / 3.0 * np.pi * np.sum(radius**3) / room
    return level, np.average(position[:, 2], weights=radius**3), solid


def curves(run, setting):
    """Mass fractions m_k(M), (3, 21)."""
    size = np.searchsorted(setting["particles"]["diameters"], run["diameter"] - 1e-6)
    return outflow(run["exit_time"], run["diameter"], size).mass_fraction


def mean_and_variance(values):
    """Mean over the seeds and the seeds' variance."""
    return np.mean(values, axis=0), np.var(values, axis=0, ddof=1)


def difference(first, second):
    """Root mean square over M of the difference of two codes' mean curves (seeds, 21), and the one expected
    if they agree: sqrt(mean over M of (s_1^2 + s_2^2) / n)."""
    (mean_1, var_1), (mean_2, var_2) = mean_and_variance(first), mean_and_variance(second)
    found = np.sqrt(np.mean((mean_1 - mean_2) ** 2))
    return found, np.sqrt(np.mean((var_1 + var_2) / len(first)))


def spread(values, unit, scale=1.0, digits=3):
    """Mean ± standard error, as text."""
    mean, var = mean_and_variance(np.asarray(values) * scale)
    return f"{mean:.{digits}f} ± {np.sqrt(var / len(values)):.{digits}f} {unit}".strip()


def measure(figures):
    """Rows of the comparison, and its figure."""
    setting = case(1, "cdt")
    liggghts_runs.program()
    runs = {
        name: [
            peer_run(seed) if "LIGGGHTS" in name else own_run(seed, rolling) for seed in range(1, SEEDS + 1)
        ]
        for name, rolling in SOLVERS.items()
    }
    last = {name: [np.nanmax(run["exit_time"]) for run in of] for name, of in runs.items()}
    fraction = {name: np.array([curves(run, setting) for run in of]) for name, of in runs.items()}
    beds = {name: np.array([bed(run, setting) for run in of]) for name, of in runs.items()}
    if Path(figures).is_dir():
        draw(Path(figures) / "liggghts_hopper.png", runs, fraction)
    peer, own, study = SOLVERS
    rows = [
        within(
            "mean discharge time of five fillings, cdt",
            np.mean(last[peer]),
            np.mean(last[own]),
            0.03,
            "s",
            True,
        )
    ]
    for k, symbol in enumerate(("m_f(M)", "m_i(M)")):
        found, expected = difference(fraction[peer][:, k], fraction[own][:, k])
        text = f"{symbol}: rms difference of the means over the expected one ({found:.4f} / {expected:.4f})"
        rows.append(at_most(text, 1.5, found / expected))
    rows += described(last, fraction, beds, peer, own, study)
    return rows


def described(last, fraction, beds, peer, own, study):
    """Rows that are reported and not judged."""
    rows = [reported("discharge time, edem", spread(last[peer], "s"), spread(last[study], "s"))]
    for k, symbol in enumerate(("m_f(M)", "m_i(M)")):
        found, expected = difference(fraction[peer][:, k], fraction[study][:, k])
        text = f"{symbol}, edem: rms difference from LIGGGHTS (expected: from the seeds alone)"
        rows.append(reported(text, f"{expected:.4f}", f"{found:.4f}"))
    bed_rows = (
        ("top of the bed", "mm", 1e3, 2),
        ("its centre of mass", "mm", 1e3, 3),
        ("its solid fraction", "", 1, 4),
    )
    for name, label in ((own, "cdt"), (study, "edem")):
        for k, (what, *form) in enumerate(bed_rows):
            texts = (spread(beds[code][:, k], *form) for code in (peer, name))
            rows.append(reported(f"{what} at the opening, {label}", *texts))
    return rows


def reported(test, expected, obtained):
    """A row without judgement."""
    return Row(test, expected, obtained, "", True)


def draw(path, runs, fraction):
    """Mean curves with bands of one standard error, and the discharged mass of every run against time."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(9.0, 3.0), layout="constrained")
    for name, colour in COLOURS.items():
        for ax, k in zip(axes, (0, 1), strict=False):
            mean, var = mean_and_variance(fraction[name][:, k])
            error = np.sqrt(var / SEEDS)
            ax.fill_between(GRID, mean - error, mean + error, color=colour, alpha=0.2, lw=0)
            ax.plot(GRID, mean, color=colour, label=name)
        for run in runs[name]:
            order = np.argsort(run["exit_time"])[: np.count_nonzero(np.isfinite(run["exit_time"]))]
            mass = np.cumsum(run["diameter"][order] ** 3)
            axes[2].plot(run["exit_time"][order], mass / mass[-1], color=colour, lw=0.7, label=name)
    for ax, k, symbol in zip(axes, (0, 1), ("f", "i"), strict=False):
        ax.set(
            xlabel="discharged mass fraction M", ylabel=f"mass fraction $m_\\mathrm{{{symbol}}}$", xlim=(0, 1)
        )
        ax.axhline((8 / 99, 27 / 99)[k], color="0.7", lw=0.7, zorder=0)
    axes[2].set(xlabel="time from the opening (s)", ylabel="M", xlim=(0, None), ylim=(0, 1.02))
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=150)
    plt.close(figure)
