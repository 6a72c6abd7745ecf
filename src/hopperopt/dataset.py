"""The plan's table, its runs gathered in one dataset, and which runs may be data points at all."""

import itertools
import json
import logging
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from hopperopt import files, indices, outflow, uncertainty, units

# What a run that did not end well cannot tell; its counts and monitors stay, to show what went wrong.
RESULTS = ("discharge_time", "discharge_rate", "mass_flow_index")
# What makes a netCDF file one of a run.
RUN = {
    "exit_time", "diameter", "size_class", "position_opening", "status", "filling_level", "filling_time",
    "residual_count", "residual_mass_fraction", "max_overlap", "max_speed_ratio", "max_energy_gain",
    "lost_particles", *RESULTS,
}  # fmt: skip
CONVENTIONS = "CF-1.11"
RANKING = outflow.SIZE_CLASSES[:2]  # whose objectives rank the designs
NAMED = 30  # experiments in one sentence


def write_plan(params: Mapping, output: str | os.PathLike) -> None:
    """Write design.csv: experiment, a column for each factor, a column of level numbers for each factor.

    params: `factors`, their names in order; `experiments`, dicts of `name`, `design` and `levels` (1-based
    numbers; empty without levels, as are their columns then).
    """
    rows = [
        {"experiment": row["name"]}
        | {factor: row["design"][factor] for factor in params["factors"]}
        | {f"{factor}_level": row["levels"].get(factor) for factor in params["factors"]}
        for row in params["experiments"]
    ]
    files.write_table(pd.DataFrame(rows), output)


def gather(
    params: Mapping, design: Iterable, simulations: Iterable, output: str, runs: str, designs: str
) -> None:
    """Write the dataset (netCDF) of plan and rounds of infill, a table of its runs, one of its designs (CSV).

    params: `factors`, names of columns of the tables `design`, the plan's first and then one for each round;
    `incomplete`, refuse or drop.
    simulations: the runs' files, named EXPERIMENT_rep_REPLICATE.nc. Raises files.InputError naming the runs
    that did not end well, unless they are to be dropped: then they are NaN in the dataset (InputError if none
    is left).
    """
    simulated = read_runs(simulations)
    ends = {key: run.drop_dims(run.dims) for key, run in simulated.items()}  # without the particles
    if missed := missed_levels(ends):
        logging.warning(missed)
    unusable = unusable_runs(ends)
    if unusable and params["incomplete"] != "drop":
        raise files.InputError(refusal(unusable))
    tables = [files.read_table(path, "experiment", *params["factors"]) for path in design]
    plan = pd.concat(tables).set_index("experiment")[list(params["factors"])]
    dataset = assemble(plan, simulated, unusable)
    files.write_netcdf(dataset, output)
    files.write_table(table_of_runs(dataset), runs)
    files.write_table(ranked_designs(dataset), designs)


class RunFiles(Mapping[tuple[str, int], xr.Dataset]):
    """Runs by (name, replicate) as datasets; each is read when it is asked for, and none is kept."""

    def __init__(self, paths: Mapping[tuple[str, int], Path]):
        self._paths = paths

    def __getitem__(self, key: tuple[str, int]) -> xr.Dataset:
        path = self._paths[key]
        run = files.read_netcdf(path)
        if missing := RUN - set(run.data_vars):
            raise files.InputError(f"{path}: is no run of a simulation: no {', '.join(sorted(missing))}")
        return run.drop_dims("snapshot", errors="ignore")  # snapshots are large

    def __iter__(self) -> Iterator[tuple[str, int]]:
        return iter(self._paths)

    def __len__(self) -> int:
        return len(self._paths)


def read_runs(paths: Iterable) -> RunFiles:
    """Runs by (name, replicate), both from the file's name NAME_rep_REPLICATE.nc; files.InputError else.

    A file that is damaged or holds no run raises files.InputError, naming it, when its run is asked for.
    """
    found = {}
    for path in map(Path, paths):
        match = re.fullmatch(r"(.+)_rep_(\d+)\.nc", path.name)
        if match is None:
            raise files.InputError(f"{path}: a run's file is named NAME_rep_REPLICATE.nc")
        found[match[1], int(match[2])] = path
    return RunFiles(found)


def unusable_runs(runs: Mapping[tuple[str, int], xr.Dataset]) -> dict[tuple[str, int], str]:
    """Reason, in words, for each run that is no data point: everything but status `complete`."""
    return {key: outcome(run) for key, run in runs.items() if run["status"].item() != "complete"}


def missed_levels(runs: Mapping[tuple[str, int], xr.Dataset]) -> str | None:
    """Sentence naming experiments whose bed missed its level by more than a coarse diameter, or None."""
    missed = {}
    for key, run in runs.items():
        if "case" not in run.attrs:
            continue
        case = json.loads(run.attrs["case"])
        miss = float(run["filling_level"]) - case["filling"]["level"]
        if abs(miss) > max(case["particles"]["diameters"]):
            missed[key] = 1e3 * miss
    if not missed:
        return None
    named = list(dict.fromkeys(name for name, _ in missed))
    others = f" and {len(named) - NAMED} more" if len(named) > NAMED else ""
    return (
        f"the bed missed its level by {min(missed.values()):+.1f} to {max(missed.values()):+.1f} mm "
        f"in {', '.join(named[:NAMED])}{others} (more than a coarse particle)"
    )


def outcome(run: xr.Dataset) -> str:
    """How a run ended: its status, and the numbers that explain it."""
    status = run["status"].item()
    inside = f"{float(run['residual_mass_fraction']):.1%} of the mass stayed inside"
    return {
        "jammed": f"jammed, {inside}",
        "incomplete": f"incomplete at its time limit, {inside}",
        "unsettled": f"unsettled, the bed still moved after {float(run['filling_time']):.3g} s of filling",
        "monitor": "monitor, out of its bounds: "
        f"overlap {float(run['max_overlap']):.3g} of the smaller radius, "
        f"speed {float(run['max_speed_ratio']):.3g} of free fall, "
        f"{int(run['lost_particles'])} particles lost, energy gain {float(run['max_energy_gain']):.2%}",
        "complete": f"complete, empty after {float(run['discharge_time']):.3f} s"
        + (f", {int(run['residual_count'])} particles stayed" if run["residual_count"] else ""),
    }[status]


def refusal(unusable: Mapping[tuple[str, int], str]) -> str:
    """One line per run that is refused, and what can be done."""
    lines = [f"{name}_rep_{replicate}: {reason}" for (name, replicate), reason in unusable.items()]
    return "\n".join(["runs that are no data points (`incomplete: drop` leaves them out):", *lines])


def assemble(plan: pd.DataFrame, runs: Mapping, unusable: Mapping) -> xr.Dataset:
    """Dataset of all runs: dims experiment, replicate, size_class, M.

    plan: factor values in the columns, experiments in the index; runs and reasons by (experiment, replicate).
    """
    replicates = sorted({replicate for _, replicate in runs})
    missing = [f"{e}_rep_{r}" for e in plan.index for r in replicates if (e, r) not in runs]
    if missing:
        raise files.InputError(f"no run of {', '.join(missing)}")
    first = next(iter(runs))
    target = common_target({first: runs[first]})
    points = []
    for key in itertools.product(plan.index, replicates):
        run = runs[key]
        common_target({key: run}, (first, target))
        points.append(_data_point(run, target, key in unusable))
    variables = {}
    for name, first_point in points[0].items():
        values = np.stack([point[name].values for point in points])
        values = values.reshape(len(plan), len(replicates), *first_point.shape)
        variables[name] = ("experiment", "replicate", *first_point.dims), values, first_point.attrs
    attributes = {"factors": " ".join(plan.columns)}
    dataset = xr.Dataset(variables, _coordinates(plan, replicates, target), attributes)
    return _described(dataset.assign(_of_designs(dataset)), unusable)


def common_target(runs: Mapping, known: tuple | None = None) -> np.ndarray:
    """Mass fractions m_k0 of the batch, which must be those of every run.

    known: a run's name and its mass fractions, which they must be too.
    """

    def batch(run):
        return outflow.batch_fractions(run["diameter"].values, run["size_class"].values)

    name, target = known or next((key, batch(run)) for key, run in runs.items())
    for key, run in runs.items():
        if not np.allclose(batch(run), target, rtol=0, atol=1e-9):
            raise files.InputError(f"the batches of {name} and {key} differ in composition")
    return target


def _data_point(run: xr.Dataset, target: np.ndarray, unusable: bool) -> dict[str, xr.Variable]:
    """Everything that the dataset holds of one run, by name."""
    point = {name: values.variable for name, values in run.data_vars.items() if values.ndim == 0}
    composition = outflow.outflow(run["exit_time"].values, run["diameter"].values, run["size_class"].values)
    order = indices.residence_order(run["exit_time"].values, run["position_opening"].values)
    fraction, variance = composition if not unusable else np.full_like(composition, np.nan)
    point[indices.ORDER] = xr.Variable((), order)
    if unusable:
        point |= {name: point[name].copy(data=np.array(np.nan)) for name in (*RESULTS, indices.ORDER)}
    by_size = {
        "J": outflow.objective(fraction, target),
        "U": outflow.corrected_square(fraction, target, variance),
        **indices.of_outflow(fraction, variance, target),
    }
    return {
        **point,
        "mass_fraction": xr.Variable(("size_class", "M"), fraction),
        "counting_variance": xr.Variable(("size_class", "M"), variance),
        **{name: xr.Variable("size_class", values) for name, values in by_size.items()},
    }


def _of_designs(dataset: xr.Dataset) -> dict:
    """Variables of whole designs: the noise between their replicates, and U of their mean curves."""
    runs, target = replicates(dataset), dataset["target_fraction"].values
    pooled = uncertainty.pooled_variance(runs)
    U = uncertainty.estimate(runs, target, pooled)
    counted = uncertainty.estimate(runs, target, runs.counting)
    dimensions = ("experiment", "size_class", "M")
    return {
        "runs": ("experiment", runs.number[:, 0, 0]),
        "scatter_variance": (dimensions, runs.scatter),
        "pooled_variance": (dimensions[1:], pooled),
        "U_design": (dimensions[:2], U.square),
        "U_design_variance": (dimensions[:2], U.variance),
        "U_design_counting_variance": (dimensions[:2], counted.variance),
    }


def replicates(dataset: xr.Dataset) -> uncertainty.Runs:
    """The replicates of each design joined; arrays (experiment, size class, M)."""
    order = ("experiment", "replicate", "size_class", "M")
    return uncertainty.of_runs(
        *(dataset[name].transpose(*order).values for name in ("mass_fraction", "counting_variance"))
    )


def _coordinates(plan: pd.DataFrame, replicates: list[int], target: np.ndarray) -> dict:
    return {
        "experiment": ("experiment", list(map(str, plan.index)), {"long_name": "experiment"}),
        "replicate": (
            "replicate", replicates, {"long_name": "replicate, a filling with its own seed", "units": "1"}
        ),
        "size_class": ("size_class", list(outflow.SIZE_CLASSES), {"long_name": "size class"}),
        "M": ("M", outflow.GRID, {"long_name": "discharged mass fraction", "units": "1"}),
        "target_fraction": (
            "size_class", target, {"long_name": "mass fraction of the batch", "units": "1"}
        ),
        **{
            name: ("experiment", plan[name].to_numpy(dtype=float), _factor_attributes(name))
            for name in plan.columns
        },
    }  # fmt: skip


def _factor_attributes(name: str) -> dict[str, str]:
    return {"long_name": f"factor {name}", "units": units.split(name)[1].cf}


def _described(dataset: xr.Dataset, unusable: Mapping) -> xr.Dataset:
    """Attach attributes to the variables made here and to the whole."""
    names = indices.LONG_NAMES | {
        "mass_fraction": "mass fraction of the size class in the outflow",
        "counting_variance": "counting variance of the mass fraction in one run",
        "J": "raw objective, rms over M of the deviation from the batch",
        "U": "objective squared, less the counting variance; may be negative",
        "runs": "number of replicates that are data points",
        "scatter_variance": "variance of the mass fraction between the replicates",
        "pooled_variance": "variance of the mass fraction between replicates, pooled over the experiments",
        "U_design": "objective squared of the replicates' mean, less its noise; may be negative",
        "U_design_variance": "variance of U_design, from the pooled variance between replicates",
        "U_design_counting_variance": "variance of U_design, were counting the only noise",
    }
    for name, text in names.items():
        dataset[name].attrs = {"long_name": text, "units": "1"}
    dropped = [f"{name}_rep_{replicate}: {reason}" for (name, replicate), reason in unusable.items()]
    return dataset.assign_attrs(
        Conventions=CONVENTIONS,
        title="Outflow of the hopper in the experiments",
        source="discrete element simulations",
        dropped_runs="; ".join(dropped),
    )


def table_of_runs(dataset: xr.Dataset) -> pd.DataFrame:
    """One row per run: its factors, status, counts, times, monitors, raw objectives and indices, for people.

    Squares without their noise are printed as sign(U) sqrt|U|, under the name of the objective.
    """
    stacked = dataset.stack(run=("experiment", "replicate"), create_index=False)
    columns = ["experiment", "replicate", *_factors(dataset), "status"]
    scalars = [
        n for n, v in dataset.data_vars.items() if v.dims == ("experiment", "replicate") and n != "status"
    ]
    table = {name: stacked[name].values for name in [*columns, *scalars]}
    if "filling_level" in table:
        table["filling_level_mm"] = 1e3 * table.pop("filling_level")
    for name in ("J", *indices.OF_SIZES):
        for size in dataset["size_class"].values:
            values = stacked[name].sel(size_class=size).values
            printed = outflow.signed_root(values) if name.startswith("U_") else values
            table[f"{name.replace('U_', 'J_')}_{size}"] = printed
    return pd.DataFrame(table)


def ranked_designs(dataset: xr.Dataset) -> pd.DataFrame:
    """One row per design, the least segregating first: factors, number of runs, J with its interval of 90 %.

    J is sign(U) sqrt|U| of the replicates' mean. `rank` goes by U_f / mean U_f + U_i / mean U_i; designs
    without a run come last. Raises files.InputError if no design has one.
    """
    table = pd.DataFrame({name: dataset[name].values for name in ("experiment", *_factors(dataset), "runs")})
    if not table["runs"].any():
        raise files.InputError("no experiment has a complete run: there is nothing to rank")
    score = 0.0
    for name in RANKING:
        data = dataset.sel(size_class=name)
        U = uncertainty.Estimate(data["U_design"].values, data["U_design_variance"].values)
        for end, square in zip(("", "_low", "_high"), (U.square, *U.interval()), strict=True):
            table[name + end] = outflow.signed_root(square)
        # A mean below zero, where noise is all there is, must not turn the order round.
        score = score + U.square / abs(np.nanmean(U.square))
    table["rank"] = pd.Series(score).rank(method="first").astype("Int64")
    return table.sort_values("rank")


def _factors(dataset: xr.Dataset) -> list[str]:
    """Names of the factors in the study's order, which the coordinates lose in a file."""
    return dataset.attrs["factors"].split()
