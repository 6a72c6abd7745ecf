"""A study as the page needs it: what the stages have written, read."""

import json
import os
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import pandas as pd
import xarray as xr

from hopperopt import dataset, files
from hopperopt.report import facts
from hopperopt.surrogate import choice

Runs = dict[tuple[str, int], xr.Dataset]


class Study(NamedTuple):
    """What the page is made of; the tables and data sets are those of the files of their names."""

    kinds: dict[str, str]  # of the verification cases, by name
    keys: dict[str, str]  # of the factors in the configuration
    data: xr.Dataset
    effects: pd.DataFrame
    selected: dict
    front: pd.DataFrame
    verdict: pd.DataFrame
    validation: pd.DataFrame
    surrogate: xr.Dataset
    undetectable: list[str]
    proposals: pd.DataFrame  # of all rounds of infill, with what was simulated; empty without any
    plan: Runs  # without the particles
    infill: Runs  # likewise
    verification: Runs

    def of_case(self, name: str) -> Runs:
        """The runs of a verification case."""
        return {key: run for key, run in self.verification.items() if key[0] == name}

    def usable(self, name: str) -> list[xr.Dataset]:
        """Those of a case's runs that are data points."""
        return [run for run in self.of_case(name).values() if run["status"].item() == "complete"]

    def shown(self, name: str) -> xr.Dataset:
        """The run of a case whose particles are drawn: the first that ended well, or else the first."""
        return next(iter([*self.usable(name), *self.of_case(name).values()]))

    def words(self) -> dict[str, str]:
        """Plain names of the factors."""
        return facts.factor_words(self.keys)


def case(run: xr.Dataset) -> dict:
    """The case that a run simulated."""
    return json.loads(run.attrs["case"])


def read(
    params: Mapping,
    data: str | os.PathLike,
    effects: str | os.PathLike,
    validation: str | os.PathLike,
    comparison: str | os.PathLike,
    surrogate: str | os.PathLike,
    front: str | os.PathLike,
    selected: str | os.PathLike,
    verdict: str | os.PathLike,
    proposals: Iterable,
    designs: Iterable,
    simulations: Iterable,
    verification: Iterable,
) -> Study:
    """Read the files of the stage `report`, see page.report."""
    ends = {key: run.drop_dims(run.dims) for key, run in dataset.read_runs(simulations).items()}
    proposed = rounds(proposals, designs)
    names = set(proposed.get("experiment", ()))
    return Study(
        kinds=dict(params["cases"]),
        keys={name: params["derived"]["keys"][name] for name in params["factors"]},
        data=files.read_netcdf(data),
        effects=files.read_table(effects),
        selected=files.read_yaml(selected),
        front=files.read_table(front),
        verdict=files.read_table(verdict),
        validation=files.read_table(validation),
        surrogate=files.read_netcdf(surrogate),
        undetectable=choice.undetectable(choice.squared_errors(files.read_netcdf(comparison))),
        proposals=proposed,
        plan={key: run for key, run in ends.items() if key[0] not in names},
        infill={key: run for key, run in ends.items() if key[0] in names},
        verification=dict(dataset.read_runs(verification)),
    )


def rounds(proposals: Iterable, designs: Iterable) -> pd.DataFrame:
    """The designs of all rounds, as proposed and as the last round's table of designs has them simulated."""
    tables = [files.read_table(path, "experiment", "chosen_as") for path in proposals]
    if not tables:
        return pd.DataFrame()
    (simulated,) = (files.read_table(path, "experiment", "runs") for path in designs)
    columns = ["experiment", *simulated.columns[simulated.columns.get_loc("runs") :]]
    return pd.concat(tables).merge(simulated[columns], "left", "experiment")
