"""The stage `verify`: the cases simulated anew, beside their predictions and against the bare hopper."""

import json
import os
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
import xarray as xr

from hopperopt import dataset, files, outflow, uncertainty
from hopperopt.outflow import SIZE_CLASSES
from hopperopt.surrogate import prediction
from hopperopt.uncertainty import SIGMAS, Estimate
from hopperopt.verdict import COLUMNS, NONE, Case, Prediction, judge

PLAN_BEST = "plan_best"
SMALLEST = {"best_f": "J_fine", "best_i": "J_intermediate", PLAN_BEST: "rank"}  # picks a row of a table
DRAWS = 1000  # of the surrogate, for the limits of what it predicts


def verify(
    params: Mapping, simulations: Iterable, surrogate: str, designs: str, verdict: str, glance: str
) -> None:
    """Write the verdict, numbers for a row per case and objective, and the same at a glance, in words.

    params: `cases`, pairs of name and kind in order; `incomplete`, refuse or drop; `seed`, of the surrogate's
    draws. simulations: the cases'
    runs, named CASE_rep_REPLICATE.nc; surrogate: path of model.nc; designs: path of designs.csv. Raises
    files.InputError naming the runs that did not end well, unless they are to be dropped; a case without any
    run left has empty cells.
    """
    runs = dict(dataset.read_runs(simulations))  # each is asked for several times
    unusable = dataset.unusable_runs(runs)
    if unusable and params["incomplete"] != "drop":
        raise files.InputError(dataset.refusal(unusable))
    predictor = prediction.load(surrogate)
    cases, facts = [], []
    for name, kind in params["cases"]:
        own = {key: run for key, run in runs.items() if key[0] == name}
        usable = [run for key, run in own.items() if key not in unusable]
        design = json.loads(next(iter(own.values())).attrs["case"])["design"]
        cases.append(Case(name, kind, predict(predictor, design, params["seed"]), curves(usable)))
        times = [float(run["discharge_time"]) for run in usable]
        factors = {factor: design.get(factor, np.nan) for factor in predictor.factors}
        facts.append({**factors, "discharge_time_s": np.mean(times) if times else np.nan})
    table = judge(cases, dataset.common_target(runs))
    files.write_table(table[list(COLUMNS)], verdict)
    files.write_table(at_a_glance(table, facts, params["cases"], files.read_table(designs, "rank")), glance)


def found_design(kind: str, path: str | os.PathLike, factors: Iterable[str]) -> dict[str, float]:
    """The design, by factor, that a simulation gets from a result of the study.

    kind: selected (path: selected.yaml), best_f or best_i (front.csv), plan_best (designs.csv), or the name
    of a design of infill (proposals.csv). Raises files.InputError where a proposal is not in the table.
    """
    if kind == "selected":
        return files.read_yaml(path, "design")["design"]
    if (by := SMALLEST.get(kind)) is None:
        table = files.read_table(path, "experiment", *factors)
        table = table[table["experiment"] == kind]
        if table.empty:
            raise files.InputError(f"{path}: has no {kind}")
        row = table.index[0]
    else:
        table = files.read_table(path, by, *factors)
        row = table[by].idxmin()
    return {name: float(table.loc[row, name]) for name in factors}


def predict(predictor: prediction.Predictor, design: Mapping[str, float], seed: int) -> Prediction:
    """What the surrogate says of a design; NaN for the bare hopper.

    Limits and variance are those of its draws there. A single network has none: its error of J counts as a
    standard deviation e, the same everywhere, so that J squared has the variance 4 J^2 e^2 + 2 e^4; without a
    known error there are no limits, and no variance.
    """
    if not design:
        return NONE
    where = predictor.array(design)
    J = predictor.objectives(where)[0]
    if predictor.knows_its_error:
        drawn = predictor.draws(where, DRAWS, np.random.default_rng(seed))[:, 0]
        drawn = outflow.objective(drawn, predictor.batch)
        low, high = np.quantile(drawn, [uncertainty.LEVEL, 1 - uncertainty.LEVEL], axis=0)
        return Prediction(J, low, high, Estimate(J**2, np.var(drawn**2, axis=0)))
    error = np.full_like(J, np.nan) if predictor.objective_error is None else predictor.objective_error
    variance = np.nan_to_num(4 * J**2 * error**2 + 2 * error**4)
    return Prediction(J, np.maximum(J - SIGMAS * error, 0), J + SIGMAS * error, Estimate(J**2, variance))


def curves(runs: list[xr.Dataset]) -> uncertainty.Runs:
    """Mean outflow and noise of the runs of one design; NaN without any."""
    names = ("exit_time", "diameter", "size_class")
    flows = [outflow.outflow(*(run[name].values for name in names)) for run in runs]
    if not flows:
        flows = [outflow.Outflow(*np.full((2, len(SIZE_CLASSES), outflow.GRID.size), np.nan))]
    return uncertainty.of_runs(*map(np.stack, zip(*flows, strict=True)))


def at_a_glance(table: pd.DataFrame, facts: list[dict], cases: list, designs: pd.DataFrame) -> pd.DataFrame:
    """A row per case and objective, in words: its J fresh, predicted and, for plan_best, in the plan.

    table: as `verdict.judge` makes it; facts: factors and discharge time of each case; designs: designs.csv.
    """
    kinds, best = dict(cases), designs.loc[designs["rank"].idxmin()]
    fact = pd.DataFrame(facts, index=list(kinds))
    rows = []
    for _, row in table.iterrows():
        in_plan = [best[row["objective"] + end] for end in ("", "_low", "_high")]
        rows.append(
            {
                "case": row["case"],
                **fact.loc[row["case"]],
                "objective": row["objective"],
                "n": row["n"],
                "J_simulated": _in_words(*row[["simulated", "low", "high"]]),
                "J_predicted": _in_words(*row[["predicted", "predicted_low", "predicted_high"]]),
                "J_in_plan": _in_words(*in_plan) if kinds[row["case"]] == PLAN_BEST else None,
                "against_bare": _against_bare(row),
            }
        )
    return pd.DataFrame(rows)


def _in_words(value, low, high):
    """A number with its interval of 90 %, where it has one; None for NaN."""
    if np.isnan(value):
        return None
    return f"{value:.4f}" + ("" if np.isnan(low) else f" ({low:.4f} to {high:.4f})")


def _against_bare(row):
    if row["verdict"] != "not distinguishable":
        return row["verdict"]
    return f"not distinguishable: {row['diff_bare']:+.1e} in J squared, {row['detectable']:.1e} would be told"
