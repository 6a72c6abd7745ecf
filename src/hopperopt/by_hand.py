"""One simulation as a person names it on the command line: a study, a design of it, a seed."""

import argparse
from pathlib import Path

from hopperopt.document import ConfigError, NotAllowed, lookup
from hopperopt.quantity import Quantity

MOST_SEED = 2**63 - 1
DEFAULT = (Path("config.yaml"),)
SHORTHANDS = {"theta": "theta_deg", "length": "length_mm", "height": "height_mm"}


def add_options(command: argparse.ArgumentParser) -> None:
    """Add the options that name a simulation."""
    command.add_argument(
        "--configfile",
        nargs="+",
        type=Path,
        default=list(DEFAULT),
        metavar="YAML",
        help="the study; later files override earlier ones (default: config.yaml)",
    )
    for option, name in SHORTHANDS.items():
        command.add_argument(f"--{option}", metavar="VALUE", help=f"short for --factor {name}=VALUE")
    command.add_argument(
        "--factor", action="append", default=[], metavar="NAME=VALUE", help="value of a factor of the study"
    )
    command.add_argument("--no-insert", action="store_true", help="the bare hopper")
    command.add_argument(
        "--seed", type=_seed, metavar="N", help="seed of the filling (default: from the study's)"
    )


def named(given: argparse.Namespace) -> list[str]:
    """Options that were given, none where all have their defaults."""
    options = {
        "--configfile": given.configfile != list(DEFAULT),
        **{f"--{option}": getattr(given, option) is not None for option in SHORTHANDS},
        "--factor": given.factor != [],
        "--no-insert": given.no_insert,
        "--seed": given.seed is not None,
    }
    return [option for option, used in options.items() if used]


def case(given: argparse.Namespace):
    """The case that the options name, and its study. Raises ConfigError where they name none."""
    from hopperopt import config

    study = config.parse(config.load(given.configfile), Path.cwd())
    typed = _typed_factors(given)
    if given.no_insert:
        if typed:
            raise ConfigError(f"--no-insert goes without values of factors ({', '.join(typed)})")
        case = study.simulation_case(None, "by_hand", 1)
    else:
        case = config.derived_case(study.derived_params("by_hand", 1), _design(study, typed))
    return case if given.seed is None else case | {"seed": given.seed}, study


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_SEED:
        raise argparse.ArgumentTypeError(
            f"{text} is not allowed; allowed: a whole number from 0 to 2**63 - 1"
        )
    return int(text)


def _typed_factors(given: argparse.Namespace) -> dict[str, str]:
    """Factor values as typed on the command line, by name."""
    typed = {name: getattr(given, option) for option, name in SHORTHANDS.items()}
    design = {name: value for name, value in typed.items() if value is not None}
    for item in given.factor:
        name, separator, value = item.partition("=")
        if not separator:
            raise ConfigError(f"--factor: {item} is not allowed; allowed: NAME=VALUE")
        design[name] = value
    return design


def _design(study, typed: dict[str, str]) -> dict[str, float]:
    """Complete design: factors that were not typed keep the value that their key has in the configuration."""
    design = {name: lookup(study.document, factor.key) for name, factor in study.factors.items()}
    for name, value in typed.items():
        if name not in design:
            raise ConfigError(f"--factor: {name} is not allowed; allowed: {', '.join(design)}")
        try:
            design[name] = Quantity().read(value)
        except NotAllowed:
            raise ConfigError(f"{name}: {value} is not allowed; allowed: a number") from None
    for name, value in design.items():
        if not isinstance(value, int | float):  # the key holds null or a word, as auto
            raise ConfigError(f"{name} has no value: give --factor {name}=VALUE")
    return design
