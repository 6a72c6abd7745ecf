"""Commands for people beside the workflow: what a study will be, how far it is, its archive, pictures."""

import argparse
import logging
import shutil
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from hopperopt import by_hand
from hopperopt.document import ConfigError


def add(commands, figures: Sequence[str]) -> None:
    """Add the commands to the subparsers; figures: paths of all figures, below the folder of results."""
    for function, name, text in (
        (_add_check, "check", "say what a study will be, before anything runs"),
        (_add_status, "status", "show how far a study is"),
        (_add_render, "render", "draw a simulation as a movie, stills, or files for ParaView"),
        (_add_export, "export", "write a simulation as input of LIGGGHTS, for beds beyond one machine"),
        (_add_archive, "archive", "put a study into one zip file"),
        (_add_reference, "reference", "write the configuration's schema and page of keys"),
    ):
        command = commands.add_parser(name, help=text)
        command.set_defaults(figures=figures)
        function(command)


def _add_study(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--configfile",
        nargs="+",
        type=Path,
        default=[],
        metavar="YAML",
        help="what overrides the config.yaml of the study's folder, as for snakemake",
    )
    command.add_argument(
        "--directory", type=Path, default=Path(), metavar="DIR", help="the study's folder (default: this one)"
    )


def _study(given: argparse.Namespace):
    """The study in a folder, its raw document and the files of that, found as Snakemake finds them."""
    from hopperopt import config

    own = given.directory / "config.yaml"
    paths = [*([own] if own.exists() or not given.configfile else []), *given.configfile]
    document = config.load(paths)
    return config.parse(document, given.directory), document, paths


def _add_check(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Say what a study will be: its simulations, particles, gaps, time step, expected time and memory; "
        "draw the hopper with the extreme inserts. Nothing is simulated."
    )
    _add_study(command)
    command.add_argument(
        "--output", type=Path, default=Path("check.png"), metavar="FILE", help="drawing to write, PNG or PDF"
    )
    command.set_defaults(action=_check)


def _check(given: argparse.Namespace) -> None:
    """Print a study's table and draw its extremes."""
    study, *_ = _study(given)
    from hopperopt import files, preview

    files.check_writable(given.output)
    print("\n".join(preview.table(study, given.directory.resolve())))
    preview.draw(study, given.output)
    print(f"{'drawing':<20}{given.output}")


def _add_status(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Show what a study has done, what runs and what is to come; from any terminal that sees its folder."
    )
    _add_study(command)
    command.add_argument("--watch", action="store_true", help="every two seconds, until all is done")
    command.set_defaults(action=_status)


def _status(given: argparse.Namespace) -> None:
    """Show how far a study is, once or until all is done."""
    from hopperopt import status

    study, *_ = _study(given)
    results, state_dir = (given.directory / folder for folder in (study.results_dir, study.state_dir))
    runs = [run._replace(file=given.directory / run.file) for run in status.planned(study)]
    figures = [results / path for path in given.figures]

    def draw():
        seen = status.look(runs, state_dir)
        lines = shutil.get_terminal_size().lines
        return status.screen(runs, seen, results, figures, lines), status.ended(seen, results, figures)

    if not given.watch:
        sys.stdout.write(draw()[0])
        return
    with suppress(KeyboardInterrupt):
        status.watch(draw, sys.stdout)


def _add_archive(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Put a study's configuration, data, tables and figures into one zip file beside its results."
    )
    _add_study(command)
    command.set_defaults(action=_archive)


def _archive(given: argparse.Namespace) -> None:
    """Write a study's archive, and say what it does not hold."""
    study, document, paths = _study(given)
    from hopperopt import archive, status

    results = given.directory / study.results_dir
    paths += [path for name in archive.tables_of(document) if (path := given.directory / name).is_file()]
    output = results.with_name(f"{results.resolve().name}.zip")
    held = archive.write(results, given.directory, paths, output)
    expected = [*status.TABLES, *status.RESULTS.values(), *given.figures, "report.html"]
    if missing := [path for path in expected if f"{archive.RESULTS}/{path}" not in held]:
        logging.warning(f"not in it, as they are not there: {', '.join(missing)}")
    print(f"{output}: {len(held)} files, {output.stat().st_size / 1e6:.1f} MB")


def _add_reference(command: argparse.ArgumentParser) -> None:
    command.description = "Write the configuration's JSON schema and the page of its keys, from its models."
    command.add_argument("--output", nargs=2, type=Path, required=True, metavar=("SCHEMA.json", "PAGE.md"))
    command.set_defaults(action=_write_reference)


def _write_reference(given: argparse.Namespace) -> None:
    from hopperopt import reference

    for path, text in zip(given.output, (reference.schema(), reference.page()), strict=True):
        path.write_text(text, encoding="utf-8")


def _add_render(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Draw a simulation: the hopper cut open, at two moments and, of its snapshots, as a movie."
    )
    command.add_argument("run", type=Path, metavar="RUN.nc", help="file of a simulation")
    command.add_argument(
        "--colour",
        choices=("size", "speed", "height"),
        default="size",
        help="of the particles (default: size)",
    )
    command.add_argument(
        "--format",
        choices=("gif", "mp4"),
        default="gif",
        help="of the movie (default: gif; mp4 takes ffmpeg)",
    )
    command.add_argument(
        "--vtk", action="store_true", help="write a series that ParaView opens (.pvd), and no pictures"
    )
    command.add_argument(
        "--output",
        type=Path,
        metavar="STEM",
        help="where to: STEM.gif, STEM_opening.png, ... (default: beside the run, by its name)",
    )
    command.set_defaults(action=_render)


def _render(given: argparse.Namespace) -> None:
    """Draw one simulation, and say what was written."""
    stem = given.run.with_suffix("") if given.output is None else given.output
    if given.vtk:
        from hopperopt import vtk

        written = [vtk.write(given.run, stem)]
    else:
        from hopperopt.figures import movie

        written = movie.write(given.run, stem, given.colour, given.format)
    print("\n".join(map(str, written)))


def _add_export(command: argparse.ArgumentParser) -> None:
    command.description = (
        "Write a simulation as input of LIGGGHTS, which shares a bed among nodes: a design named as for "
        "`simulate`, from its falling column, or a run from its settled bed."
    )
    by_hand.add_options(command)
    command.add_argument(
        "--run", type=Path, metavar="RUN.nc", help="settled bed of this simulation, in place of a design"
    )
    command.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder to write")
    command.set_defaults(action=_export)


def _export(given: argparse.Namespace) -> None:
    """Write LIGGGHTS' input, and say how it is run."""
    from hopperopt import export

    if given.run is None:
        (case, _), bed = by_hand.case(given), None
    elif named := by_hand.named(given):
        raise ConfigError(f"--run goes without {', '.join(named)}: its file holds the design")
    else:
        case, bed = export.settled(given.run)
    export.write(case, given.output, bed)
    print(f"{given.output}: mpirun -np 16 liggghts -in {export.SCRIPT}, in that folder")
