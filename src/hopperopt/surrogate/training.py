"""The stage `train`: networks of every hidden size, their errors, and the one that is used."""

import json
import os
from collections.abc import Mapping
from importlib import metadata
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from hopperopt.files import InputError, read_netcdf, write_table
from hopperopt.outflow import signed_root
from hopperopt.surrogate import features, prediction
from hopperopt.surrogate.estimator import NetworkRegressor
from hopperopt.surrogate.network import Ensemble
from hopperopt.surrogate.split import TEST, TRAINING, VALIDATION, folds
from hopperopt.surrogate.targets import clip_limits

FOLDS = 5


class Points(NamedTuple):
    """All points of the curves as rows; targets (n, outputs) as simulated, and clipped for the training."""

    inputs: np.ndarray
    targets: np.ndarray
    clipped: np.ndarray
    use: np.ndarray  # (n,) training, validation or test
    groups: np.ndarray  # (n,) labels of what is never divided: experiments, or single points


def train(
    params: Mapping, training: str | os.PathLike, network: str | os.PathLike, errors: str | os.PathLike
) -> None:
    """Train all hidden sizes and starts, write the selected network and the table of errors.

    params: `hidden_nodes` (list), `starts`, `selected_hidden_nodes` (one of them or "auto"), `seed`.
    training: path of training.nc; network, errors: paths of network.nc and errors.csv.

    Per hidden size the start with the smallest validation error is kept. `auto` takes the size with the
    smallest error in a 5-fold cross-validation over all experiments (or points) but the test's. The test
    chooses nothing.
    """
    data = read_netcdf(training)
    points = read_points(data)
    trained, stopping = points.use == TRAINING, points.use == VALIDATION
    validation = points.inputs[stopping], points.targets[stopping]
    choice, scores = choose_size(points, params, data.attrs["clip_sigma"])
    regressors = {
        size: NetworkRegressor(size, params["starts"], params["seed"]).fit(
            points.inputs[trained], points.clipped[trained], validation
        )
        for size in params["hidden_nodes"]
    }
    write_table(_error_table(points, regressors, scores, choice), errors)
    _save(network, data, regressors[choice], params)


def read_points(data: xr.Dataset) -> Points:
    """Rows of a training data set as the stage `filter` writes it."""
    designs = np.column_stack([data[name].values for name in data.attrs["factors"].split()])
    count, moments = len(designs), data.sizes["M"]
    by_row = {
        name: data[name].transpose("experiment", "M", "output").values.reshape(count * moments, -1)
        for name in ("target", "target_clipped")
    }
    use = data["split"].values
    whole = use.ndim == 1
    return Points(
        features.rows(designs, data["M"].values),
        by_row["target"],
        by_row["target_clipped"],
        np.repeat(use, moments) if whole else use.ravel(),
        np.repeat(np.arange(count), moments) if whole else np.arange(count * moments),
    )


def choose_size(points: Points, params: Mapping, clip_sigma: float) -> tuple[int, dict[int, np.ndarray]]:
    """The number of hidden nodes, given or the best in the cross-validation, and the errors of the latter.

    params as in `train`; raises files.InputError for a given number that is none of `hidden_nodes`.
    """
    sizes, choice = params["hidden_nodes"], params["selected_hidden_nodes"]
    if choice == "auto":
        scores = cross_validate(points, params, clip_sigma)
        # Ties go to the smaller network.
        return min(sorted(sizes), key=lambda size: np.mean(scores[size] ** 2 / _variances(points))), scores
    if choice not in sizes:
        raise InputError(f"selected_hidden_nodes: {choice} is not allowed; allowed: auto, {sizes}")
    return choice, {}


def cross_validate(points: Points, params: Mapping, clip_sigma: float) -> dict[int, np.ndarray]:
    """Errors of every hidden size at experiments (or points) that neither trained nor stopped its networks.

    Each of the five folds is predicted once, the next one stops the training and chooses the start, the other
    three train, clipped to limits of their own. Rows of the test take no part.
    Returns {hidden size: rmse (outputs,)} against targets as simulated.
    """
    points = Points(*(part[points.use != TEST] for part in points))
    if len(np.unique(points.groups)) < FOLDS:
        raise InputError(f"selected_hidden_nodes: auto needs {FOLDS} experiments that are not the test's")
    fold = folds(points.groups, FOLDS, params["seed"])
    squares = {size: np.zeros(points.targets.shape[1]) for size in params["hidden_nodes"]}
    for judging in range(FOLDS):
        judged, stopping = fold == judging, fold == (judging + 1) % FOLDS
        for size in squares:
            regressor = NetworkRegressor(size, params["starts"], params["seed"])
            fit_clipped(regressor, points, ~judged & ~stopping, stopping, clip_sigma)
            missed = regressor.predict(points.inputs[judged]) - points.targets[judged]
            squares[size] += np.sum(missed**2, axis=0)
    return {size: np.sqrt(total / len(points.targets)) for size, total in squares.items()}


def fit_clipped(
    regressor: NetworkRegressor, points: Points, trained: np.ndarray, stopping: np.ndarray, clip_sigma: float
) -> NetworkRegressor:
    """Fit a regressor to the rows `trained`, clipped to limits of their own; the rows `stopping` stop it.

    trained, stopping: masks (n,); clip_sigma: the limits in standard deviations, infinite for none.
    """
    targets = points.targets[trained]
    low, high = clip_limits(targets.T[None], True, clip_sigma)
    validation = points.inputs[stopping], points.targets[stopping]
    return regressor.fit(points.inputs[trained], np.clip(targets, low, high), validation)


def _variances(points):
    """Variance of each output over all rows but the test's, which puts the outputs on one scale."""
    return points.targets[points.use != TEST].var(axis=0)


def _error_table(points, regressors, scores, choice):
    """A row per hidden size; rmse in mass fraction, against the simulated, never clipped, mass fractions."""
    table = []
    for size, regressor in regressors.items():
        squares = (regressor.predict(points.inputs) - points.targets) ** 2
        row = {"hidden": size, "start": regressor.start_, "epochs": regressor.epochs_[regressor.start_]}
        for use in (TRAINING, VALIDATION, TEST):
            rmse = np.sqrt(squares[points.use == use].mean(axis=0))
            row |= {f"{use}_rmse_{name}": value for name, value in zip(features.OUTPUTS, rmse, strict=True)}
        rmse = scores.get(size, np.full(len(features.OUTPUTS), np.nan))
        row |= {
            f"cross_validation_rmse_{name}": value for name, value in zip(features.OUTPUTS, rmse, strict=True)
        }
        table.append(row | {"selected": size == choice})
    return pd.DataFrame(table)


def _objective_error(data, predictor):
    """How far predicted objectives are off: rms of J less sign(U) sqrt|U|, (outputs,).

    Over the experiments that stopped the training, since the test chooses nothing; with the points split
    every experiment has trained in part, and all count. The counting noise of U itself is part of it.
    """
    designs = np.column_stack([data[name].values for name in predictor.factors])
    simulated = signed_root(data["U"].transpose("experiment", "output").values)
    difference = predictor.objectives(designs) - simulated
    use = data["split"].values
    judging = use == VALIDATION if use.ndim == 1 else np.full(len(use), True)
    return np.sqrt(np.mean(difference[judging] ** 2, axis=0))


def _save(path, data, regressor, params):
    """Write the selected network with everything that says where it comes from."""
    predictor = prediction.Predictor(
        tuple(data.attrs["factors"].split()),
        data["M"].values,
        data["target_fraction"].values,
        Ensemble((regressor.network_,)),
    )
    predictor = predictor._replace(objective_error=_objective_error(data, predictor))
    additions = {name: data[name] for name in ("clip_low", "clip_high", "split")}
    attributes = {
        "title": "surrogate of the outflow: feed-forward network, logistic hidden nodes, linear outputs",
        "hidden_nodes": regressor.hidden_nodes,
        "selection": "cross-validation" if params["selected_hidden_nodes"] == "auto" else "given",
        "start": regressor.start_,
        "starts": regressor.starts,
        "epochs": int(regressor.epochs_[regressor.start_]),
        "seed": params["seed"],
        "seed_rule": "numpy SeedSequence(seed, spawn_key=(hidden_nodes, start))",
        "validation_error": regressor.validation_errors_[regressor.start_],
        "split_by": data.attrs["split_by"],
        "split_seed": data.attrs["seed"],
        "clip_sigma": data.attrs["clip_sigma"],
        "versions": json.dumps({name: metadata.version(name) for name in ("numpy", "scipy", "scikit-learn")}),
    }
    prediction.save(path, predictor, additions, attributes)
