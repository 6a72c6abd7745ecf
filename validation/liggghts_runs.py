"""Runs of LIGGGHTS, another DEM code, on what `hopperopt.liggghts` writes; and the same in this solver."""

import hashlib
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import Simulation
from validation.kept import kept
from validation.report import Missing


def simulation(scene, time_step):
    """A scene in this project's solver."""
    return Simulation(
        scene.position,
        scene.velocity,
        scene.radius,
        scene.density,
        scene.walls,
        contact_law(scene.sphere, scene.sphere, *scene.pair),
        contact_law(scene.sphere, scene.wall, *scene.touch),
        time_step,
        gravity=scene.gravity,
        rolling=scene.rolling,
    )


def program():
    """Path of the `liggghts` command; raises `Missing` without."""
    path = shutil.which("liggghts")
    if path is None:
        raise Missing(
            "LIGGGHTS is not here (Debian and Ubuntu: apt-get install --no-install-recommends liggghts)."
        )
    return path


def run(files, folder):
    """Write a deck's files into a folder and run its `in.start` on one core; returns the log's text."""
    for name, text in files.items():
        Path(folder, name).write_text(text)
    command = [program(), "-in", "in.start", "-log", "none"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode or "ERROR" in done.stdout:
        raise RuntimeError(f"LIGGGHTS ended with an error:\n{done.stdout[-2000:]}")
    return done.stdout


def kept_run(name, files, read):
    """`read(folder, log)`'s arrays of a run, from the store if the very same files have been run before."""

    def make():
        with tempfile.TemporaryDirectory() as folder:
            log = run(files, folder)
            return read(Path(folder), log)

    key = {file: hashlib.sha256(text.encode()).hexdigest() for file, text in files.items()}
    return kept(name, key, make, solver=False)


def outflow_file(path):
    """Exit times (s) and diameters (m) of what passed the sensor, in that order."""
    table = np.loadtxt(path, comments="#", ndmin=2)
    return table[:, 1], table[:, 2]


def look_file(path):
    """Positions (n, 3) and radii (n,) that `look` wrote, by identity, m."""
    table = np.loadtxt(path, skiprows=9, ndmin=2)
    table = table[np.argsort(table[:, 0])]
    return table[:, 1:4], table[:, 4]


def thermo(log):
    """Rows (step, spheres, kinetic energy in J, s of the clock) of all runs in a log, (n, 4)."""
    number = r"[-+0-9.eE]+"
    rows = re.findall(rf"^\s+(\d+)\s+(\d+)\s+({number}|-?nan)\s+({number})\s*$", log, re.MULTILINE)
    return np.array(rows, dtype=float)


def loop_times(log):
    """Seconds that each `run` of a script took by LIGGGHTS' own clock."""
    return [float(text) for text in re.findall(r"^Loop time of (\S+) on", log, re.MULTILINE)]
