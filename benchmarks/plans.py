"""The stages after the simulations with plans of many experiments: `python benchmarks/plans.py 25 500 5000`.

The commands are those that Snakemake would run, in its order. In place of a simulation stands a file of 3,000
particles that leave in a random order, whose mixture follows the design; one fold of the surrogates'
comparison is run and stands for all. A row for each stage: CPU time, largest memory, size of what it wrote.
"""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr
import yaml

from hopperopt import config, files, verify
from hopperopt.experiment import SCALARS

ROOT = Path(__file__).resolve().parent.parent
MODULE = "python -m hopperopt "
STUDY = {
    "surrogate": {"model": "gaussian", "hidden_nodes": [7], "starts": 5, "validation": {"starts": 2}},
    "verification": {"replicates": 1, "replicates_of": {}},
}
SIZE_CLASS = np.repeat(np.arange(3, dtype=np.int8), 1000)
LEAN = np.array([[0.5, -0.3, 0.2], [-0.1, 0.3, -0.2], [-0.2, 0.1, 0.1]])  # of a size, by the factors
MEASURE = """
import os, sys
_, status, usage = os.wait4(os.posix_spawnp("bash", ["bash", sys.argv[1]], os.environ), 0)
print(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)
sys.exit(status != 0)
"""
POSITION = np.random.default_rng(0).uniform(-0.05, 0.05, (len(SIZE_CLASS), 3)).astype(np.float32)


def commands(folder: Path) -> list[tuple[list[str], str]]:
    """Words and text of all commands of the study in a folder, in their order."""
    program = [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "--directory", folder]
    options = ["--workflow-profile", "none", "--cores", "1", "--dry-run", "--printshellcmds", "--nocolor"]
    listed = subprocess.run([*program, *options], check=True, stdout=subprocess.PIPE, text=True).stdout
    texts = re.findall(r"^Shell command: (.*?)\n\n", listed, re.MULTILINE | re.DOTALL)
    return [(shlex.split(text.partition(MODULE)[2]), text) for text in texts if MODULE in text]


def simulated(words: list[str], folder: Path) -> xr.Dataset:
    """What stands in place of a run: each size leaves early or late as the design has it."""
    case = json.loads(words[words.index("--case") + 1])
    if "found" in case:
        table = folder / words[words.index("--design") + 1]
        case = config.derived_case(case, verify.found_design(case["found"], table, case["keys"]))
    ranges = {"theta_deg": (50, 60), "length_mm": (30, 50), "height_mm": (26, 34)}
    design = [
        np.interp(case["design"].get(name, low), (low, high), (0, 1)) for name, (low, high) in ranges.items()
    ]
    rng = np.random.default_rng(case["seed"])
    place = rng.random(len(SIZE_CLASS))
    exit_time = place + (design @ LEAN)[SIZE_CLASS] / np.pi * np.sin(np.pi * place)
    values = {
        "status": "complete", "filling_level": case["filling"]["level"], "residual_mass_fraction": 0.0,
        "discharge_time": 1.1 + 0.2 * design[2],
    }  # fmt: skip
    return xr.Dataset(
        {name: ((), values.get(name, 0), about) for name, about in SCALARS.items()}
        | {
            "exit_time": ("particle", exit_time),
            "diameter": ("particle", np.array(case["particles"]["diameters"])[SIZE_CLASS]),
            "size_class": ("particle", SIZE_CLASS),
            "position_opening": (("particle", "xyz"), POSITION),
            "position_half": (("particle", "xyz"), np.where(exit_time[:, None] > 0.5, POSITION, np.nan)),
        },
        attrs={
            "case": json.dumps(case),
            "seed": case["seed"],
            "wall_time_s": 20.0,
            "particle_steps_per_s": 1e7,
        },
    )


def measured(text: str, folder: Path) -> tuple[float, float]:
    """CPU time (s) and largest memory (MB) of a command.

    It is run from a file, as it may be longer than arguments are; and by a small process, since a new process
    begins with the largest memory of the one that starts it.
    """
    script = folder / "command.sh"
    script.write_text(text)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    program = [sys.executable, "-c", MEASURE, script]
    done = subprocess.run(program, cwd=folder, env=os.environ | {"PATH": path}, stdout=subprocess.PIPE)
    if done.returncode:
        raise SystemExit(f"this failed in {folder}: {text[:300]} ...")
    seconds, memory = map(float, done.stdout.split())
    return seconds, memory


def run(experiments: int, folder: Path) -> None:
    """Run the stages of a study and print a row for each."""
    document = config.load([ROOT / "config.yaml"])
    document |= STUDY | {"design": {"plan": "lhs", "replicates": 1, "lhs": {"experiments": experiments}}}
    (folder / "config.yaml").write_text(yaml.safe_dump(document))
    fold = None
    for words, text in commands(folder):
        outputs = [folder / path for path in words[words.index("--output") + 1 : words.index(">")]]
        for path in (*outputs, folder / words[words.index(">") + 1]):
            path.parent.mkdir(parents=True, exist_ok=True)
        if words[0] == "simulate":
            files.write_netcdf(simulated(words, folder), outputs[0])
        elif words[0] == "validate_fold" and fold is not None:
            files.write_netcdf(fold.assign_attrs(experiment=outputs[0].stem), outputs[0])
        else:
            seconds, memory = measured(text, folder)
            if words[0] == "validate_fold":
                fold = files.read_netcdf(outputs[0])
            name = " ".join(words[: 2 if words[0] == "figure" else 1])
            sizes = ", ".join(f"{path.name} {path.stat().st_size / 1024:,.0f} KiB" for path in outputs)
            print(f"{experiments:6,d}  {name:20s} {seconds:7.1f} s {memory:6.0f} MB  {sizes}", flush=True)


def main() -> None:
    """Run the plans one after the other, each in a temporary folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("experiments", nargs="+", type=int)
    for experiments in parser.parse_args().experiments:
        with tempfile.TemporaryDirectory() as folder:
            run(experiments, Path(folder))


if __name__ == "__main__":
    main()
