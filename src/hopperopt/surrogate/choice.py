"""The stage `choose`: the surrogate that the study goes on with."""

import logging
import os
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from hopperopt.files import read_netcdf, write_netcdf
from hopperopt.outflow import objective
from hopperopt.surrogate import ensemble, gaussian, prediction
from hopperopt.surrogate.features import OUTPUTS
from hopperopt.surrogate.folds import BASELINE, CLIPPED
from hopperopt.surrogate.network import Ensemble
from hopperopt.surrogate.training import choose_size

# What predicts curves from the design, the simplest first.
CANDIDATES = ("gaussian", "ensemble", f"ensemble{CLIPPED}", "network", f"network{CLIPPED}")
DRAWS = 1000  # of curves, for the uncertainty of J
SPREAD = 250  # designs at most at which they are drawn, all at once

log = logging.getLogger(__name__)


def choose(
    params: Mapping,
    training: str | os.PathLike,
    network: Sequence[str | os.PathLike],
    validation: Sequence[str | os.PathLike],
    output: str | os.PathLike,
) -> None:
    """Write surrogate/model.nc: the surrogate named, or for `auto` the one that compares best.

    params: `model` (paper, network, ensemble, gaussian or auto); for networks `hidden_nodes` (list),
    `starts`, `selected_hidden_nodes` and `seed`. training: path of training.nc; network: that of
    network.nc, which `gaussian` does without; validation: that of validation.nc for auto, else none. With
    `auto` a warning names the objectives in which no candidate beats the mean of the experiments.
    """
    data, name, chosen = read_netcdf(training), params["model"], "given"
    clip = CLIPPED if np.isfinite(data.attrs["clip_sigma"]) else ""
    if name == "auto":
        errors, chosen = squared_errors(read_netcdf(validation[0])), "compared"
        name = best(errors)
        log.info(f"the surrogate is {name}")
        for lost in undetectable(errors):
            log.warning(f"no effect of the design is detectable in the objective of the {lost} particles")
    elif name != "gaussian":
        name = {"paper": "network"}.get(name, name) + clip
    if name == f"network{clip}":  # that of the stage `train`, with all that it says of itself
        write_netcdf(read_netcdf(network[0]).assign_attrs(surrogate=name, chosen=chosen), output)
        return
    predictor = prediction.Predictor(
        tuple(data.attrs["factors"].split()),
        data["M"].values,
        data["target_fraction"].values,
        _fitted(name, data, params),
    )
    if name == "network":  # compared, and not the one of `train`, whose targets are clipped
        error = np.sqrt(errors[name].mean(axis=0))
    else:
        error = _spread(predictor, data, params["seed"])
    predictor = predictor._replace(objective_error=error)
    attributes = {"title": f"surrogate of the outflow: {name}", "surrogate": name, "chosen": chosen}
    prediction.save(output, predictor, {}, attributes | {"seed": params["seed"]})


def squared_errors(validation: xr.Dataset) -> dict[str, np.ndarray]:
    """Squared errors of J, (experiments, outputs), of the baseline and the candidates in validation.nc."""
    squares = (validation["J"] - validation["simulated_J"]) ** 2
    squares = squares.transpose("surrogate", "experiment", "output")
    named = dict(zip(map(str, validation["surrogate"].values), squares.values, strict=True))
    return {name: named[name] for name in (BASELINE, *CANDIDATES) if name in named}


def best(errors: Mapping[str, np.ndarray]) -> str:
    """The simplest candidate within one standard error of the best.

    A candidate's score is the sum over the objectives of its rms error over that of the baseline; the
    standard error is that of the difference between two scores, both on the same experiments (jackknife).
    errors: as `squared_errors` returns them.
    """
    number = len(errors[BASELINE])
    without = ~np.eye(number, dtype=bool)  # row k leaves experiment k out

    def scores(rows):
        rms = {name: np.sqrt(squares[rows].mean(axis=0)) for name, squares in errors.items()}
        return {name: float(np.sum(rms[name] / rms[BASELINE])) for name in errors if name != BASELINE}

    whole, parts = scores(slice(None)), [scores(rows) for rows in without]
    first = min(whole, key=whole.get)

    def standard_error(name):
        differences = [part[name] - part[first] for part in parts]
        return np.sqrt((number - 1) * np.var(differences))

    return next(name for name in whole if whole[name] - whole[first] <= standard_error(name))


def undetectable(errors: Mapping[str, np.ndarray]) -> list[str]:
    """Outputs in whose objective no candidate beats the baseline by more than one paired standard error."""
    gains = [errors[BASELINE] - squares for name, squares in errors.items() if name != BASELINE]
    beaten = [gain.mean(axis=0) > gain.std(axis=0, ddof=1) / np.sqrt(len(gain)) for gain in gains]
    return [name for name, any_beats in zip(OUTPUTS, np.any(beaten, axis=0), strict=True) if not any_beats]


def _fitted(name, data, params):
    """The model of a name, from all experiments; a single network is the ensemble's first member."""
    if name == "gaussian":
        return gaussian.fit(data)
    sigma = data.attrs["clip_sigma"]
    size, _ = choose_size(ensemble.whole_experiments(data), params, sigma)
    sigma = sigma if name.endswith(CLIPPED) else np.inf
    members = ensemble.fit(data, size, params["starts"], sigma, params["seed"])
    return Ensemble(members.members[:1]) if name.startswith("network") else members


def _spread(predictor, data, seed):
    """Standard deviation of J over draws, (outputs,), rms over designs of the training set."""
    designs = np.column_stack([data[factor].values for factor in predictor.factors])
    designs = designs[:: -(-len(designs) // SPREAD)]
    J = objective(predictor.draws(designs, DRAWS, np.random.default_rng(seed)), predictor.batch)
    return np.sqrt(np.mean(J.var(axis=0), axis=0))
