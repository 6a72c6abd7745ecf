"""Reading and writing the study's files.

Every file appears under its name only when it is whole: it is written beside its place under a hidden name
and then renamed, so that an interrupted job leaves either the old file or none.
"""

import errno
import glob
import os
import secrets
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
import xarray as xr
import yaml

_stamp: ContextVar[Mapping[str, str]] = ContextVar("stamp", default=MappingProxyType({}))


class InputError(ValueError):
    """What a person gave cannot be used; the message is all that needs to be said."""


@contextmanager
def stamped(attributes: Mapping[str, str]) -> Iterator[None]:
    """Give every netCDF file that is written inside these attributes, such as versions and host."""
    token = _stamp.set(attributes)
    try:
        yield
    finally:
        _stamp.reset(token)


@contextmanager
def atomic(path: str | os.PathLike) -> Iterator[Path]:
    """Give a temporary path beside `path` (same suffix); what was written there takes its place at the end.

    The folder of `path` is made. After an exception the temporary file is removed and `path` is as it was; an
    OSError names `path`.
    """
    path = Path(path)
    temporary = path.with_name(f".{secrets.token_hex(4)}.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        if error.filename in (None, temporary, str(temporary)):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def remove_leftovers(path: str | os.PathLike) -> None:
    """Remove what writers of `path` that were killed have left. Only for who knows that nobody writes it."""
    path = Path(path)
    for temporary in path.parent.glob(f".????????.{glob.escape(path.name)}"):
        temporary.unlink()


def check_writable(path: str | os.PathLike) -> None:
    """Make the folder of a file that is to be written; raises OSError, naming it, where that cannot be."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path.parent)) from None


def write_netcdf(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write a dataset as netCDF-4, arrays of numbers compressed, coordinates without a fill value.

    The file is made in memory: then what goes wrong in writing it, such as a full disk, is an OSError that
    says so.
    """
    encoding: dict = {}
    for name, variable in dataset.variables.items():
        numeric = variable.dtype.kind in "fiub"
        encoding[name] = (
            {"zlib": True, "complevel": 4, "shuffle": True} if numeric and variable.size > 1 else {}
        )
        if variable.dtype.kind == "f" and name in dataset.coords:
            encoding[name]["_FillValue"] = None
    content = dataset.assign_attrs(_stamp.get()).to_netcdf(
        engine="netcdf4", format="NETCDF4", encoding=encoding
    )
    with atomic(path) as temporary:
        temporary.write_bytes(content)


def read_netcdf(path: str | os.PathLike) -> xr.Dataset:
    """Read a whole netCDF file into memory and close it; InputError when it is damaged or no netCDF file."""
    try:
        return xr.load_dataset(path, engine="netcdf4")
    except FileNotFoundError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise _damaged(path, "netCDF file", reason) from None


def write_table(table: pd.DataFrame, path: str | os.PathLike) -> None:
    """Write a table as CSV, without its index, numbers with ten digits, missing values empty."""
    with atomic(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g", lineterminator="\n")


def read_table(path: str | os.PathLike, *columns: str) -> pd.DataFrame:
    """Read a CSV table; InputError when it is damaged, has no row or lacks one of the columns."""
    try:
        table = pd.read_csv(path)
    except ValueError as error:  # of pandas' parser, and of text that is no UTF-8
        raise _damaged(path, "CSV table", " ".join(str(error).split())) from None
    missing = [column for column in columns if column not in table]
    if missing or table.empty:
        raise _damaged(path, "CSV table", f"no column {missing[0]}" if missing else "no row")
    return table


def write_yaml(document: Mapping, path: str | os.PathLike) -> None:
    """Write a mapping as YAML in its own order; numpy numbers and arrays become plain ones."""
    with atomic(path) as temporary:
        temporary.write_text(
            yaml.safe_dump(_plain(document), sort_keys=False, allow_unicode=True, width=100), encoding="utf-8"
        )


def read_yaml(path: str | os.PathLike, *keys: str) -> dict:
    """Read a YAML mapping; InputError when it is damaged or lacks one of the keys."""
    try:
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (ValueError, yaml.YAMLError) as error:
        raise _damaged(path, "YAML file", " ".join(str(error).split())) from None
    if not isinstance(document, dict):
        raise _damaged(path, "YAML file", "no mapping")
    if missing := [key for key in keys if key not in document]:
        raise _damaged(path, "YAML file", f"no key {missing[0]}")
    return document


def _damaged(path, kind, reason):
    """What to say of a result that cannot be read."""
    return InputError(f"{path}: is damaged or no {kind} ({reason}); delete it, and snakemake makes it anew")


def _plain(value):
    """Copy nested containers with numpy scalars and arrays turned into Python's own numbers and lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value
