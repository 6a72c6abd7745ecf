"""The command line, `python -m hopperopt`: one command per stage of the workflow, and one simulation by hand.

A stage's command gets its configuration as one JSON string and its files as options; it calls one function,
`stage(params, *inputs, *outputs)`. What a stage needs is imported when it runs.
"""

import argparse
import errno
import functools
import importlib
import json
import logging
import math
import sys
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import yaml

from hopperopt import by_hand, commands, provenance
from hopperopt.document import ConfigError, NotAllowed
from hopperopt.interruption import interruptible
from hopperopt.quantity import Quantity

BAD_INPUT = 2
STDIN = "-"  # stands for what is longer than the arguments of a command may be


class Stage(NamedTuple):
    """A stage of the workflow: its module and function, options of its inputs (`*`: several), outputs."""

    module: str
    function: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    help: str


STAGES = {
    "design": Stage("dataset", "write_plan", (), ("design.csv",), "write the plan's table"),
    "gather": Stage(
        "dataset",
        "gather",
        ("design*", "simulations*"),
        ("dataset.nc", "runs.csv", "designs.csv"),
        "gather the plan's runs",
    ),
    "effects": Stage(
        "effects", "effects", ("dataset",), ("effects.csv", "anova.csv"), "effects of the plan's factors"
    ),
    "filter": Stage(
        "surrogate.targets", "filter_targets", ("dataset",), ("training.nc",), "clip and split the targets"
    ),
    "train": Stage(
        "surrogate.training", "train", ("training",), ("network.nc", "errors.csv"), "train the networks"
    ),
    "validate_fold": Stage(
        "surrogate.folds", "fold", ("training",), ("EXPERIMENT.nc",), "predict one experiment from the others"
    ),
    "validate": Stage(
        "surrogate.validation",
        "validate",
        ("training", "folds*"),
        ("validation.csv", "validation.nc"),
        "compare the surrogates",
    ),
    "choose": Stage(
        "surrogate.choice",
        "choose",
        ("training", "network*", "validation*"),
        ("model.nc",),
        "choose the surrogate and fit it",
    ),
    "sensitivity": Stage(
        "sensitivity",
        "sensitivity",
        ("surrogate", "dataset"),
        ("sobol.csv",),
        "sensitivity of the surrogate to the factors",
    ),
    "optimise": Stage(
        "optimise",
        "optimise",
        ("surrogate",),
        ("front.csv", "history.nc", "selected.yaml"),
        "search the best designs and select one",
    ),
    "propose": Stage(
        "infill",
        "propose",
        ("surrogate", "plan", "front", "proposals*"),
        ("proposals.csv",),
        "propose the designs of a round of infill",
    ),
    "verify": Stage(
        "verify",
        "verify",
        ("simulations*", "surrogate", "designs"),
        ("verdict.csv", "glance.csv"),
        "judge the cases simulated anew",
    ),
    "report": Stage(
        "report.page",
        "report",
        (
            "dataset",
            "effects",
            "validation",
            "comparison",
            "surrogate",
            "front",
            "selected",
            "verdict",
            "proposals*",
            "designs*",
            "simulations*",
            "verification*",
            "figures*",
        ),
        ("report.html",),
        "write the study on one page",
    ),
}
SIMULATION, RECORDED = "experiment", "snapshots"  # modules that simulate, without and with snapshots
# Options of each figure's inputs; a figure is drawn by the module `figures.NAME`.
FIGURES = {
    "hopper": ("run",),
    "curves": ("dataset",),
    "indices": ("dataset",),
    "effects": ("effects",),
    "fit": ("training", "network"),
    "verification": ("simulations*", "surrogate"),
    "verdict": ("verdict", "designs"),
    "front": ("front", "dataset", "verdict"),
    "errors": ("validation", "surrogate"),
    "sensitivity": ("sobol",),
}
# Those that the report shows as they are; of the others it has drawings of its own.
REPORTED = [name for name in FIGURES if name not in ("hopper", "curves", "effects")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit status: 0, or 2 for input that cannot be used (said in one sentence)."""
    logging.basicConfig(level=logging.INFO, format="%(levelname)s: %(message)s", stream=sys.stderr)
    for library in ("matplotlib", "fontTools"):  # they tell of fonts, glyph by glyph, and of writers
        logging.getLogger(library).setLevel(logging.WARNING)
    try:
        with interruptible():
            given = _parser().parse_args(arguments)
            given.action(given)
    except KeyboardInterrupt:
        print("interrupted; the same command, or `make resume`, goes on", file=sys.stderr)
        return 130
    except (ConfigError, OSError, json.JSONDecodeError) as error:
        return _refused(error)
    except ValueError as error:
        # A mistake of the program keeps its traceback.
        from hopperopt.files import InputError

        if not isinstance(error, InputError):
            raise
        return _refused(error)
    return 0


def _refused(error: Exception) -> int:
    text = str(error)
    if isinstance(error, OSError) and error.filename is not None:
        text = f"{error.filename}: {error.strerror}"
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            text += "; free some space, then the same command, or `make resume`, goes on"
    with suppress(OSError):  # where the log's disk is full, the exit status must do
        print(f"hopperopt: {text}", file=sys.stderr)
    return BAD_INPUT


def _log_heading(settings: Mapping) -> None:
    """What a log begins with: versions, place, and the settings of the job."""
    made_by = provenance.attributes()
    versions = ", ".join(f"{name} {number}" for name, number in json.loads(made_by["versions"]).items())
    logging.info(f"hopperopt {made_by['hopperopt_version']} (git {made_by['git']}) on {made_by['host']}")
    logging.info(f"{versions}")
    text = yaml.safe_dump(settings, sort_keys=False, default_flow_style=None, width=100, allow_unicode=True)
    logging.info("settings:\n" + textwrap.indent(text.rstrip(), "    "))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="hopperopt", description=__doc__.splitlines()[0])
    parser.add_argument("--version", action="version", version=f"hopperopt {provenance.version()}")
    stages = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_simulate(stages.add_parser("simulate", help="run one simulation"))
    for name, stage in STAGES.items():
        _add_stage(stages.add_parser(name, help=stage.help), stage)
    figure = stages.add_parser("figure", help="draw one figure")
    names = figure.add_subparsers(metavar="NAME", required=True)
    for name, inputs in FIGURES.items():
        stage = Stage(f"figures.{name}", "write", inputs, ("NAME.png", "NAME.pdf"), f"draw {name}")
        _add_stage(names.add_parser(name, help=stage.help), stage)
    commands.add(stages, [f"figures/{name}.{suffix}" for name in FIGURES for suffix in ("png", "pdf")])
    return parser


def _add_stage(command: argparse.ArgumentParser, stage: Stage) -> None:
    command.add_argument(
        "--params", type=_json, required=True, metavar="JSON", help="configuration; - reads it from stdin"
    )
    for option in stage.inputs:
        count = {"nargs": "*", "help": "- reads their paths from stdin"} if option.endswith("*") else {}
        command.add_argument(f"--{option.rstrip('*')}", required=True, metavar="FILE", **count)
    command.add_argument("--output", required=True, nargs=len(stage.outputs), metavar=stage.outputs)
    command.set_defaults(action=_run_stage, stage=stage)


def _json(text: str) -> dict:
    try:
        return json.loads(sys.stdin.read() if text == STDIN else text)
    except json.JSONDecodeError as error:
        raise argparse.ArgumentTypeError(f"no JSON: {error}") from None


def _threads(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not allowed; allowed: a whole number from 1")
    return int(text)


def _minutes(text: str) -> float:
    try:
        return math.inf if text == "null" else Quantity(above=0).read(text)
    except NotAllowed as allowed:
        raise argparse.ArgumentTypeError(f"{text} is not allowed; allowed: {allowed} or null") from None


def _run_stage(given: argparse.Namespace) -> None:
    """Call the stage's function with its parameters, inputs and outputs."""
    _log_heading(given.params)
    inputs = [getattr(given, option.rstrip("*")) for option in given.stage.inputs]
    inputs = [sys.stdin.read().splitlines() if paths == [STDIN] else paths for paths in inputs]
    from hopperopt import files

    if "derived" in given.params:
        given.params["case_of"] = functools.partial(_derived_case, given.params["derived"])
    module = importlib.import_module(f"hopperopt.{given.stage.module}")
    # A figure is one thing in several formats: it takes its outputs as one list.
    outputs = [given.output] if given.stage.function == "write" else given.output
    with files.stamped(provenance.attributes()):
        getattr(module, given.stage.function)(given.params, *inputs, *outputs)


def _derived_case(params: Mapping, design: Mapping[str, float]) -> dict | None:
    """The case of a design that the study found, or None where it cannot be simulated."""
    from hopperopt import config

    with suppress(ConfigError):
        return config.derived_case(params, design)
    return None


def _add_simulate(command: argparse.ArgumentParser) -> None:
    command.description = "Run one simulation of a design, or of the bare hopper, as the configuration says."
    by_hand.add_options(command)
    command.add_argument(
        "--threads", type=_threads, metavar="N", help="threads to work with (default: the configuration's)"
    )
    command.add_argument(
        "--checkpoint-minutes",
        type=_minutes,
        metavar="N",
        help="how often the state is saved, null: never (default: the configuration's)",
    )
    command.add_argument(
        "--state-dir",
        type=Path,
        metavar="DIR",
        help="where the state is saved (default: .state in the study's folder of results)",
    )
    command.add_argument("--case", type=_json, metavar="JSON", help=argparse.SUPPRESS)
    command.add_argument("--design", nargs="*", default=[], metavar="FILE", help=argparse.SUPPRESS)
    command.add_argument("--output", type=Path, required=True, metavar="FILE", help="netCDF file to write")
    command.set_defaults(action=_simulate)


def _simulate(given: argparse.Namespace) -> None:
    """Run one simulation and write its file."""
    case, running = _case(given)
    chosen = {name: getattr(given, name) for name in running._fields if getattr(given, name) is not None}
    # The workflow's digest only makes Snakemake run this anew; what is recorded is the code that runs.
    case.pop("code", None)
    from hopperopt import files

    files.check_writable(given.output)  # before hours of work
    _log_heading(case)
    digest = provenance.code_digest(f"hopperopt.{RECORDED if 'snapshot_interval' in case else SIMULATION}")
    from hopperopt.simulate import simulate

    simulate(case, digest, given.output, **running._replace(**chosen)._asdict())


class Running(NamedTuple):
    """How a simulation is run, which changes no bit of its result."""

    threads: int = 1
    checkpoint_minutes: float | None = None
    state_dir: Path = Path(".state")


def _case(given: argparse.Namespace) -> tuple[dict, Running]:
    """The case to simulate (the workflow's, that of a design the study found, one by hand), and how."""
    if given.case is not None and not given.design:
        return given.case, Running()
    if given.case is not None:
        from hopperopt import config, verify

        design = verify.found_design(given.case["found"], given.design[0], given.case["keys"])
        return config.derived_case(given.case, design), Running()
    case, study = by_hand.case(given)
    settings = study.simulation
    running = Running(settings.threads, settings.checkpoint_minutes, Path(study.state_dir))
    return case, running
