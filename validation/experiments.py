"""Whole experiments of the study, two at a time, kept."""

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from hopperopt import config, design, experiment
from hopperopt.provenance import code_digest, compile_solver
from validation.kept import kept

CONFIG = Path(__file__).resolve().parent.parent / "config.yaml"
PARTICLES = ("exit_time", "diameter", "size_class", "position_opening")
SCALARS = ("filling_time", "filling_level", "discharge_time", "discharge_rate", "status")


def study():
    """The study of config.yaml."""
    return config.parse(config.load([CONFIG]), CONFIG.parent)


def centre(study):
    """The design of the plan's middle levels."""
    return design.centre(study.levels)


def cases(study, design, name, seeds):
    """(name, case) of a study's design (None: bare hopper) for each of a number of seeds, the name's own."""
    return [(name, study.simulation_case(design, name, seed)) for seed in range(seeds)]


def run(named_cases):
    """Arrays of each experiment, in the order given: what is named above, and `filling_share`.

    `filling_share` is the part of the computing time until the gate opens.
    """
    return in_two_processes(_run, named_cases)


def in_two_processes(function, items):
    """`function` (of a module) of each item; items are taken in their order, so the longest come first."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context, initializer=compile_solver) as pool:
        return list(pool.map(function, items))


def _run(named_case):
    name, case = named_case
    return kept(name, [case, code_digest("hopperopt.experiment")], lambda: _measure(case), solver=False)


def _measure(case):
    """Arrays of one experiment. Processor time, so that others at work on the machine do not count."""
    begun, reports = time.process_time(), []
    data = experiment.run(case, lambda report: reports.append((report, time.process_time())))
    opened = _opening(reports, float(data.filling_time))
    share = (opened - begun) / (time.process_time() - begun)
    return {name: data[name].values for name in PARTICLES + SCALARS} | {"filling_share": np.array(share)}


def _opening(reports, filling_time):
    """Processor time at which the gate opened: by simulated time between the reports before and after."""
    before = [(report.time, at) for report, at in reports if report.stage != "discharge"]
    after = [(filling_time + report.time, at) for report, at in reports if report.stage == "discharge"]
    return (
        float(np.interp(filling_time, *zip(*before[-1:], *after[:1], strict=True)))
        if before and after
        else np.nan
    )
