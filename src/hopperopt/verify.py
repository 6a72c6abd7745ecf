"""Prediction against simulation, per verification case and objective."""

import json
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
import xarray as xr

from hopperopt import dataset, files, outflow
from hopperopt.surrogate import features, prediction


def verify(params: Mapping, simulations: Iterable, network: str, output: str) -> None:
    """Write the table of predicted and simulated objectives: a row per case and objective.

    params: `cases`, their names in order; `incomplete`, refuse or drop. simulations: the cases' runs, named
    CASE_rep_REPLICATE.nc. Raises files.InputError naming the runs that did not end well, unless they are to
    be dropped; a case without any run left has empty cells.
    """
    runs = dataset.read_runs(simulations)
    unusable = dataset.unusable_runs(runs)
    if unusable and params["incomplete"] != "drop":
        raise files.InputError(dataset.refusal(unusable))
    predictor = prediction.load(network)
    rows = []
    for case in params["cases"]:
        replicates = sorted(replicate for name, replicate in runs if name == case)
        design = json.loads(runs[case, replicates[0]].attrs["case"])["design"]
        usable = [runs[case, replicate] for replicate in replicates if (case, replicate) not in unusable]
        rows += summarise(case, design, usable, predictor)
    files.write_table(pd.DataFrame(rows), output)


def summarise(
    case: str, design: Mapping, runs: list[xr.Dataset], predictor: prediction.Predictor
) -> list[dict]:
    """Rows of one case: factors, predicted J (none for the bare hopper), J of its runs raw and corrected.

    With n runs J is that of their mean curve. The noise subtracted is the counting variance for n = 1 and the
    scatter between the runs otherwise.
    """
    names = features.OUTPUTS
    predicted = predictor.objectives(predictor.array(design))[0] if design else [np.nan] * len(names)
    simulated = _simulated(runs, len(names))
    discharge_time = np.mean([run["discharge_time"] for run in runs]) if runs else np.nan
    return [
        {
            "case": case,
            "objective": name,
            "replicates": len(runs),
            **{factor: design.get(factor, np.nan) for factor in predictor.factors},
            "predicted_J": predicted[k],
            **{column: values[k] for column, values in simulated.items()},
            "discharge_time_s": discharge_time,
        }
        for k, name in enumerate(names)
    ]


def _simulated(runs: list[xr.Dataset], classes: int) -> dict[str, np.ndarray]:
    """Simulated objectives of the first `classes` size classes, by column."""
    columns = ("simulated_J_raw", "simulated_J_corrected", "counting_floor")
    if not runs:
        return dict.fromkeys(columns, np.full(classes, np.nan))
    variables = ("exit_time", "diameter", "size_class")
    curves = [outflow.outflow(*(run[name].values for name in variables)) for run in runs]
    target = outflow.batch_fractions(runs[0]["diameter"].values, runs[0]["size_class"].values)
    fraction = np.stack([curve.mass_fraction for curve in curves])
    counting = np.mean([curve.counting_variance for curve in curves], axis=0) / len(runs)
    noise = counting if len(runs) == 1 else fraction.var(axis=0, ddof=1) / len(runs)
    mean = fraction.mean(axis=0)
    corrected = outflow.signed_root(outflow.corrected_square(mean, target, noise))
    values = (outflow.objective(mean, target), corrected, outflow.counting_floor(counting))
    return {column: value[:classes] for column, value in zip(columns, values, strict=True)}
