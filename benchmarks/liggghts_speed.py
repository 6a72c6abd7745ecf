"""This solver against LIGGGHTS on one core each, in one run: `python benchmarks/liggghts_speed.py`.

The settled bed of the centre design behind a closed outlet, in particle-steps per second: the same spheres in
both codes, measured in turn, with a ratio for each turn. LIGGGHTS' time is that of its own loop, with the
fastest of a few neighbour skins. `--experiment` adds the wall time of a whole experiment, process start and
files included: the same column, the same time of filling and settling, LIGGGHTS at its largest stable step.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
os.environ["NUMBA_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"

from hopperopt import provenance  # noqa: E402

provenance.use_numba_cache()

import numpy as np  # noqa: E402
import xarray as xr  # noqa: E402

from hopperopt import liggghts  # noqa: E402
from validation import liggghts_hopper, liggghts_runs  # noqa: E402

FILLING = 0.44  # s after which the bed is at rest
OWN_STEPS, PEER_STEPS = 2000, 500  # of one turn: a second or two
RELAXING = 300  # LIGGGHTS' steps before the clock runs: it starts without springs
SKINS = (0.1, 0.2, 0.4, 0.8)  # over the smallest radius, tried once each
SETTLED_STEP = 2.0e-5  # s, LIGGGHTS in the settled bed
STABLE_STEP = 3.5e-5  # s, the largest at which LIGGGHTS fills the hopper: at 3.75e-5 it loses spheres


def settled_bed(case, turns, steps):
    """Particle-steps per second of both codes, (turns, 2): this solver, LIGGGHTS; and LIGGGHTS' skin."""
    scene = liggghts.Scene.of_case(case)
    simulation = liggghts_runs.simulation(scene, case["time_step"])
    simulation.advance(round(FILLING / case["time_step"]))
    position = simulation.by_identity(simulation.spheres.position)
    rest = replace(scene, position=position, velocity=np.zeros_like(position))
    skin = max(SKINS, key=lambda skin: peer_rate(rest, skin, steps[1]))
    rates = []
    for _ in range(turns):
        begun = time.perf_counter()
        simulation.advance(steps[0])
        own = len(position) * steps[0] / (time.perf_counter() - begun)
        rates.append((own, peer_rate(rest, skin, steps[1])))
    return np.array(rates), skin


def peer_rate(scene, skin, steps):
    """LIGGGHTS' particle-steps per second from a scene at rest, by its own clock."""
    files = scene.deck(SETTLED_STEP, skin=skin)
    files["in.start"] += f"run {RELAXING}\nrun {steps}\n"
    with tempfile.TemporaryDirectory() as folder:
        log = liggghts_runs.run(files, folder)
    return len(scene.radius) * steps / liggghts_runs.loop_times(log)[1]


def own_experiment(case, folder):
    """Wall time (s) of one experiment from the command line to its netCDF file, and that file's content."""
    output = Path(folder, "run.nc")
    command = [
        sys.executable,
        "-m",
        "hopperopt",
        "simulate",
        "--case",
        json.dumps(case),
        "--output",
        str(output),
    ]
    begun = time.perf_counter()
    subprocess.run(command, check=True, cwd=ROOT, capture_output=True)
    return time.perf_counter() - begun, xr.load_dataset(output)


def peer_experiment(case, filling, half, end, folder):
    """Wall time (s) of LIGGGHTS on the same: filled for the same time, then run until `end` (s after the
    opening); positions at the opening and at `half` (s) and the outflow written."""
    scene = liggghts.Scene.of_case(case)
    files = scene.deck(STABLE_STEP, case["discharge"]["sensor"])
    before, after = round(half / STABLE_STEP), round((end - half) / STABLE_STEP)
    files["in.start"] += (
        f"run {round(filling / STABLE_STEP)}\n{liggghts.look('opening.txt')}{scene.opening()}"
        f"run {before}\n{liggghts.look('half.txt')}run {after}\n"
    )
    begun = time.perf_counter()
    liggghts_runs.run(files, folder)
    seconds = time.perf_counter() - begun
    out = liggghts_runs.outflow_file(Path(folder, "outflow.txt"))[0]
    return seconds, len(out), out.max()


def whole_experiment(case):
    """Print the wall times of one experiment in both codes."""
    with tempfile.TemporaryDirectory() as folder:
        own, run = own_experiment(case, folder)
        exits = np.sort(run["exit_time"].values)
        half, end = float(exits[len(exits) // 2]), 1.1 * float(run["discharge_time"])
        filling = float(run["filling_time"])
        peer, left, last = peer_experiment(case, filling, half, end, folder)
    print(f"\nwhole experiment, {len(exits)} spheres, {filling:.2f} s of filling and settling in both")
    last_own, alone = float(run["discharge_time"]), run.attrs["wall_time_s"]
    print(
        f"  this solver, {1e6 * case['time_step']:.0f} us: {own:7.1f} s, last sphere out at {last_own:.2f} s"
    )
    print(f"    of it the simulation, without start and files: {alone:.1f} s")
    print(f"  LIGGGHTS, {1e6 * STABLE_STEP:.0f} us:    {peer:7.1f} s, last of {left} out at {last:.2f} s")
    print(f"  ratio {peer / own:.1f}")


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--experiment", action="store_true", help="a whole experiment as well (minutes)")
    parser.add_argument("--turns", type=int, default=5, help="of each code in the settled bed (default 5)")
    given = parser.parse_args()
    liggghts_runs.program()
    provenance.compile_solver()
    case = liggghts_hopper.case(1, "cdt")
    rates, skin = settled_bed(case, given.turns, (OWN_STEPS, PEER_STEPS))
    print(f"settled bed, {sum(case['particles']['counts'])} spheres, million particle-steps/s on one core")
    print("  turn   this solver   LIGGGHTS   ratio")
    for turn, (own, peer) in enumerate(rates / 1e6, 1):
        print(f"  {turn:4d} {own:13.2f} {peer:10.2f} {own / peer:7.2f}")
    own, peer = np.median(rates, axis=0) / 1e6
    print(f"  median {own:11.2f} {peer:10.2f} {np.median(rates[:, 0] / rates[:, 1]):7.2f}   (skin {skin:g})")
    if given.experiment:
        whole_experiment(case)


if __name__ == "__main__":
    main()
