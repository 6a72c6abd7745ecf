"""Cost per contact-step, memory and threads of large beds: `python benchmarks/scaling.py 2000 20000 200000`.

Beds of the study's spheres in a flat-bottomed cylinder about as wide as it is high, all made the same way:
tiles cut from the core of one poured bed, those that overlap across the joints taken out, at rest again after
0.2 s. Each size runs in a process of its own. `--threads 1 2` times each bed on so many threads in turn.
"""

import argparse
import gc
import json
import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
os.environ.setdefault("NUMBA_NUM_THREADS", str(os.cpu_count()))

from hopperopt import provenance

provenance.use_numba_cache()

import numpy as np  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402

from hopperopt.dem.simulation import Simulation  # noqa: E402
from hopperopt.packing import scatter  # noqa: E402
from validation.setups import DENSITY, TIME_STEP, pair_law, wall_law  # noqa: E402

RADII = np.array([1.0e-3, 1.5e-3, 2.0e-3])
SAMPLE = Path(__file__).resolve().parent / ".bed.npz"  # the poured bed that tiles are cut from
TILE = np.array([0.05, 0.05, 0.045])  # m
TOUCH = 0.98  # of the sum of two radii: what comes closer at a joint is taken out
RELAXING = 5000  # steps


def cylinder(position, radius, width, height, threads=1):
    """A simulation of spheres at rest in a cylinder of radius `width` (m) with a flat floor."""
    walls = {"cylinder": [[0.0, 0.0], [width, 0.0], [width, height]]}
    still = np.zeros_like(position)
    return Simulation(
        position, still, radius, DENSITY, walls, pair_law(), wall_law(), TIME_STEP, threads=threads
    )


def poured():
    """Positions and radii of 20,000 spheres poured into a cylinder of radius 50 mm and come to rest."""
    if not SAMPLE.exists():
        radius = np.repeat(RADII, 6667)
        start = scatter(radius, 0.048, 0.003, 0.25, np.random.default_rng(1))
        simulation = cylinder(start, radius, 0.05, 0.5)
        simulation.advance(12_000)
        np.savez(SAMPLE, position=simulation.by_identity(simulation.spheres.position), radius=radius)
    with np.load(SAMPLE) as bed:
        return bed["position"], bed["radius"]


def tiled(count):
    """A bed of about `count` spheres at rest: positions, radii and the cylinder's radius (m)."""
    position, radius = poured()
    corner = np.array([-0.5 * TILE[0], -0.5 * TILE[1], 0.008])
    inside = ((position >= corner) & (position < corner + TILE)).all(axis=1)
    tile, sizes = position[inside] - corner, radius[inside]
    width = (count * TILE.prod() / (len(tile) * 2.0 * np.pi)) ** (1.0 / 3.0)  # as high as it is wide
    across, up = int(np.ceil(2.0 * width / TILE[0])), int(np.ceil(2.0 * width / TILE[2]))
    shifts = np.array([(i, j, k) for k in range(up) for j in range(across) for i in range(across)]) * TILE
    shifts[:, :2] -= 0.5 * across * TILE[:2]
    position = (tile[None] + shifts[:, None]).reshape(-1, 3)
    radius = np.tile(sizes, len(shifts))
    position[:, 2] += RADII[-1]
    fits = np.hypot(position[:, 0], position[:, 1]) + radius < width
    fits &= position[:, 2] < 2.0 * width
    position, radius = position[fits], radius[fits]
    pairs = cKDTree(position).query_pairs(2.0 * RADII[-1], output_type="ndarray")
    gap = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    close = gap < TOUCH * (radius[pairs[:, 0]] + radius[pairs[:, 1]])
    keep = np.ones(len(radius), bool)
    keep[pairs[close].max(axis=1)] = False
    return position[keep], radius[keep], width


def measure(count, threads, steps):
    """One bed's figures as a dict; the relaxing runs on the most threads."""
    position, radius, width = tiled(count)
    begun = resident()
    simulation = cylinder(position, radius, width, 4.0 * width, max(threads))
    simulation.advance(RELAXING)
    figures = {"particles": len(radius), "bytes": resident() - begun}
    contacts = simulation.contacts().sum()
    walls = np.count_nonzero(simulation.touches.element[: simulation.touches.start[simulation.rows]] >= 0)
    figures["contacts"] = int((contacts - walls) // 2 + walls)  # a pair counts at both of its spheres
    for number in threads:
        simulation.threads = number
        simulation.advance(2)
    seconds = {number: [] for number in threads}
    for _ in range(5):
        for number in threads:
            simulation.threads = number
            before = time.perf_counter()
            simulation.advance(steps)
            seconds[number].append(time.perf_counter() - before)
    figures["seconds"] = {number: float(np.median(values)) / steps for number, values in seconds.items()}
    first = np.array(seconds[threads[0]])
    figures["faster"] = {n: float(np.median(first / np.array(values))) for n, values in seconds.items()}
    return figures


def resident():
    """Memory of this process, bytes."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main():
    """Measure each size in a process of its own and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("counts", nargs="+", type=int, help="particles of each bed")
    parser.add_argument("--threads", nargs="+", type=int, default=[1])
    parser.add_argument("--steps", type=int, help="of each timing (default: about 5 million particle-steps)")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        (count,) = given.counts
        print(json.dumps(measure(count, given.threads, given.steps or max(5, 5_000_000 // count))))
        return
    poured()
    print(
        "particles  contacts  threads  M particle-steps/s  ns per contact-step  of the first  bytes/particle"
        "  faster"
    )
    base = None
    for count in given.counts:
        options = [
            "--threads",
            *map(str, given.threads),
            *(["--steps", str(given.steps)] if given.steps else []),
        ]
        command = [sys.executable, __file__, str(count), "--one", *options]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        figures = json.loads(done.stdout)
        n, contacts = figures["particles"], figures["contacts"]
        for number, seconds in figures["seconds"].items():
            cost = 1e9 * seconds / contacts
            base = base or cost
            speed, memory = n / seconds / 1e6, figures["bytes"] / n
            line = f"{n:9d} {contacts:9d} {number:>8s} {speed:19.2f} {cost:20.1f} {cost / base:13.2f}"
            print(f"{line} {memory:15.0f} {figures['faster'][number]:7.2f}", flush=True)


if __name__ == "__main__":
    main()
