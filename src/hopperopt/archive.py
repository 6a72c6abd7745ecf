"""A study as one zip file to keep or to pass on: configuration, lock, data, tables, figures, report."""

import hashlib
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from hopperopt import files, provenance
from hopperopt.document import lookup

RESULTS = "results"  # the folder of results in the archive, whatever its own name
LEFT_OUT = {"logs", "simulations", ".state"}
RUNS = "*_rep_*.nc"  # files of single simulations: large, and what they say is in the others
DATE = (1980, 1, 1, 0, 0, 0)  # of all files in a zip, whose bytes then follow from its content


def write(results: Path, directory: Path, named: Iterable[Path], output: Path) -> list[str]:
    """Write a study's archive; return the paths that it holds.

    results: the study's folder of results, which come under `results/` without logs, states and single runs;
    named: configuration and the files that it names, which keep their place in the study's directory. Beside
    them are this clone's requirements.lock and MANIFEST.txt: version, git state, and SHA-256 sums as
    `sha256sum -c` reads them. Files of the same content give the same bytes. Raises files.InputError without
    a folder of results.
    """
    if not results.is_dir():
        raise files.InputError(f"{results}: is not there; run the study first")
    lock = provenance.PACKAGE.parents[1] / "requirements.lock"
    found = {_inside(path, directory): path for path in named}
    found |= {lock.name: lock} if lock.exists() else {}
    found |= {f"{RESULTS}/{path.relative_to(results).as_posix()}": path for path in _results(results)}
    contents = {name: found[name].read_bytes() for name in sorted(found)}
    contents["MANIFEST.txt"] = _manifest(contents)
    with files.atomic(output) as temporary, zipfile.ZipFile(temporary, "w") as file:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.external_attr = 0o644 << 16
            file.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return list(contents)


def tables_of(document: Mapping) -> Iterator[str]:
    """The CSV files that a configuration's raw document names."""
    for key in ("insert.profile.file", "design.csv.file"):
        with suppress(LookupError, TypeError):
            if path := lookup(document, key):
                yield path


def _inside(path: Path, directory: Path) -> str:
    """Path in the archive of a file of the study: as it is below the directory, or else its name."""
    path, directory = path.resolve(), directory.resolve()
    return path.relative_to(directory).as_posix() if path.is_relative_to(directory) else path.name


def _results(folder: Path) -> Iterator[Path]:
    """The files of a study, without those of another one below it."""
    for path in folder.iterdir():
        if path.is_dir():
            if path.name not in LEFT_OUT and not (path / "logs").exists():
                yield from _results(path)
        elif not path.name.startswith(".") and not path.match(RUNS):
            yield path


def _manifest(contents: Mapping[str, bytes]) -> bytes:
    made_by = f"hopperopt {provenance.version()}, git {provenance.git_state()}"
    lines = [f"# {made_by}; to check: sha256sum -c MANIFEST.txt"]
    lines += [f"{hashlib.sha256(content).hexdigest()}  {name}" for name, content in contents.items()]
    return "\n".join([*lines, ""]).encode()
