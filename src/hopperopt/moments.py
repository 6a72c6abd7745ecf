"""Where the particles of a run were at single moments: its snapshots, or the two that every run holds."""

import os
from typing import NamedTuple

import numpy as np
import xarray as xr

from hopperopt import files


class Moment(NamedTuple):
    """The particles at a time (s) from the opening: positions (n, 3) in m, NaN after the exit; speeds (n,)
    in m/s, None where they are not known."""

    time: float
    position: np.ndarray
    speed: np.ndarray | None


def read(path: str | os.PathLike) -> xr.Dataset:
    """Read a run's file; raises files.InputError when it holds none."""
    run = files.read_netcdf(path)
    if (
        not {"position_opening", "position_half", "exit_time"} <= set(run.data_vars)
        or "case" not in run.attrs
    ):
        raise files.InputError(f"{path}: is no run of a simulation")
    return run


def snapshots(run: xr.Dataset) -> list[Moment]:
    """The snapshots of a run, none where it was simulated without."""
    if "snapshot" not in run.dims:
        return []
    values = (run[name].values for name in ("snapshot_time", "position", "speed"))
    return [Moment(float(time), position, speed) for time, position, speed in zip(*values, strict=True)]


def half_time(run: xr.Dataset) -> float:
    """Time (s) at which half of the mass had left; NaN if it never did."""
    if run["position_half"].isnull().all():
        return np.nan
    order = np.argsort(run["exit_time"].values)
    mass = np.cumsum(run["diameter"].values[order] ** 3)
    # NaN, what never left, comes last.
    return float(run["exit_time"].values[order][np.searchsorted(mass, 0.5 * mass[-1])])


def stills(run: xr.Dataset) -> dict[str, Moment]:
    """The moments `opening` and `half`, when half of the mass had left (not there if it never did).

    Of a run with snapshots they are the nearest ones, which have speeds.
    """
    times = {"opening": 0.0, "half": half_time(run)}
    recorded = snapshots(run)

    def at(name, time):
        if recorded:
            return min(recorded, key=lambda moment: abs(moment.time - time))
        return Moment(time, run[f"position_{name}"].values, None)

    return {name: at(name, time) for name, time in times.items() if np.isfinite(time)}
