"""The silo of seven codes, against LIGGGHTS

Dosta et al. (Computer Physics Communications 296, 2024, 109066) compared seven open codes on a silo of 0.1 m
radius with a 45 degree cone, an outlet of 0.03 m radius and 100,000 spheres of 4 mm. Here 10,000 spheres,
larger by 10^(1/3), so that mass, bed and silo stay the same, with their materials M1 and M2 and steel walls:
no rolling friction, and twenty to forty times the modulus of the study's particles.

This solver and LIGGGHTS 3.8 start from the same column of spheres at rest, with the same step of 0.2 Rayleigh
times, and open the outlet after the same time. The rows are the largest difference, at any time, of the mass
still in the silo, over the initial mass. LIGGGHTS takes twenty minutes each; its runs are kept.
"""

from pathlib import Path

import numpy as np

from hopperopt import geometry, liggghts
from hopperopt.dem.materials import rayleigh_time
from hopperopt.packing import scatter
from validation import liggghts_runs
from validation.kept import kept
from validation.report import Row, at_most

SPHERES = 10_000
RADIUS = 0.002 * 10 ** (1 / 3)  # m
SILO_RADIUS, OUTLET_RADIUS = 0.1, 0.03  # m
STEEL = (2.1e11 / 2.4, 0.2)  # shear modulus (Pa), Poisson's ratio
# Density (kg/m3), Young's modulus (Pa), Poisson's ratio; restitution, friction and rolling friction with each
# other and with steel.
MATERIALS = {
    "M1": (2500.0, 1.0e9, 0.2, (0.5, 0.3, 0.0), (0.4, 0.2, 0.0)),
    "M2": (2000.0, 5.0e8, 0.2, (0.4, 0.4, 0.0), (0.4, 0.2, 0.0)),
}
COMPARED = ("M1", "M2")
STEP_SHARE = 0.2  # of the Rayleigh time
FILLING, DISCHARGE = 0.5, 7.0  # s; the gate opens after the first, the second is the longest discharge
SENSOR = -0.01  # m
COLUMN_FRACTION = 0.3  # solid fraction of the falling column
SEED = 1
LIMIT = 3.0  # % of the initial mass
SKIN = 0.2  # of LIGGGHTS' neighbour lists, over the radius: here the step is short


def scene(material):
    """Silo and column of spheres, and the time step (s), rounded to 1e-7 s."""
    density, young, poisson, pair, touch = MATERIALS[material]
    shear = young / (2.0 * (1.0 + poisson))
    radius = np.full(SPHERES, RADIUS)
    bottom = geometry.cone_height(OUTLET_RADIUS, 45.0, SILO_RADIUS)
    position = scatter(radius, SILO_RADIUS - RADIUS, bottom, COLUMN_FRACTION, np.random.default_rng(SEED))
    top = position[:, 2].max() + 2.0 * RADIUS
    walls = {
        "hopper": geometry.hopper(OUTLET_RADIUS, 45.0, SILO_RADIUS, top),
        "gate": geometry.gate(OUTLET_RADIUS),
    }
    velocity = np.zeros((SPHERES, 3))
    step = STEP_SHARE * rayleigh_time(RADIUS, density, shear, poisson)
    built = liggghts.Scene(
        position, velocity, radius, density, walls, (shear, poisson), STEEL, pair, touch, "none"
    )
    return built, np.floor(step * 1e7) / 1e7


def peer_run(material):
    """Exit times in LIGGGHTS, s."""
    built, step = scene(material)
    files = built.deck(step, SENSOR, SKIN)
    files["in.start"] += (
        f"run {round(FILLING / step)}\n{liggghts.look('opening.txt')}{built.opening()}"
        f"run {round(DISCHARGE / step)}\n"
    )
    return liggghts_runs.kept_run(f"liggghts-silo-{material}", files, read_peer)


def read_peer(folder, log):
    """The arrays that are kept of LIGGGHTS' run."""
    return {
        "exit_time": liggghts_runs.outflow_file(folder / "outflow.txt")[0],
        "position": liggghts_runs.look_file(folder / "opening.txt")[0].astype(np.float32),
        "thermo": liggghts_runs.thermo(log),
    }


def own_run(material):
    """Exit times (s), by this solver."""
    built, step = scene(material)

    def make():
        simulation = liggghts_runs.simulation(built, step)
        simulation.advance(round(FILLING / step))
        position = simulation.by_identity(simulation.spheres.position)
        simulation.open("gate", SENSOR)
        while simulation.count and simulation.time < DISCHARGE:
            simulation.advance(1000)
        return {
            "exit_time": simulation.exit_time,
            "position": position.astype(np.float32),
            "max_overlap": simulation.max_overlap,
        }

    key = [material, MATERIALS[material], step, FILLING, DISCHARGE, SENSOR, COLUMN_FRACTION, SPHERES, SEED]
    return kept(f"silo-{material}", key, make)


def retained(run, time):
    """Share of the spheres (all equal) still in the silo at each time, s."""
    left = np.sort(run["exit_time"][np.isfinite(run["exit_time"])])
    return 1.0 - np.searchsorted(left, time, side="right") / SPHERES


def measure(figures):
    """Rows of the comparison, and its figure."""
    liggghts_runs.program()
    rows = []
    for material in COMPARED:
        peer, own = peer_run(material), own_run(material)
        time = np.arange(0.0, DISCHARGE, 0.01)
        gap = retained(own, time) - retained(peer, time)
        worst = np.argmax(np.abs(gap))
        rows.append(
            at_most(
                f"{material}: largest difference of the retained mass (at {time[worst]:.2f} s)",
                LIMIT,
                100.0 * abs(gap[worst]),
                "% of the initial mass",
            )
        )
        texts = [f"{half_time(run):.3f} s" for run in (peer, own)]
        rows.append(Row(f"{material}: time at which half of the mass has left", *texts, "", True))
        texts = [f"{1e3 * np.mean(run['position'][:, 2]):.2f} mm" for run in (peer, own)]
        rows.append(Row(f"{material}: height of the centre of mass at the opening", *texts, "", True))
        if Path(figures).is_dir():
            draw(
                Path(figures) / f"liggghts_silo_{material}.png",
                time,
                retained(peer, time),
                retained(own, time),
            )
    return rows


def half_time(run):
    """Time at which half of the spheres have left, s."""
    return np.sort(run["exit_time"])[SPHERES // 2]


def draw(path, time, peer, own):
    """Retained mass of both codes against time, and their difference below."""
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(
        2, 1, figsize=(4.5, 4.2), sharex=True, height_ratios=(3, 1), layout="constrained"
    )
    above.plot(time, 100 * peer, color="#0072B2", lw=2.5, label="LIGGGHTS 3.8")
    above.plot(time, 100 * own, color="#D55E00", lw=1.2, ls="--", label="this solver")
    above.set(ylabel="retained mass (%)", ylim=(0, 102))
    above.legend(frameon=False)
    below.plot(time, 100 * (own - peer), color="#D55E00", lw=1.2)
    below.axhline(0, color="0.6", lw=0.7)
    for limit in (-LIMIT, LIMIT):
        below.axhline(limit, color="0.4", lw=0.8, ls=":")
    below.set(xlabel="time from the opening (s)", ylabel="difference (%)", ylim=(-4, 4))
    below.set_yticks((-LIMIT, 0, LIMIT))
    busy = time[np.maximum(peer, own) > 0]
    below.set_xlim(0, busy[-1] + 0.2)
    figure.savefig(path, dpi=150)
    plt.close(figure)
