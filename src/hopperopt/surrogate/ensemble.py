"""An ensemble of networks: the best start of each of five folds of whole experiments."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from hopperopt.surrogate.estimator import NetworkRegressor
from hopperopt.surrogate.network import Ensemble
from hopperopt.surrogate.split import TRAINING, folds
from hopperopt.surrogate.targets import clip_limits
from hopperopt.surrogate.training import FOLDS, Points, choose_size, read_points


def fit(data: xr.Dataset, params: Mapping, clip_sigma: float) -> Ensemble:
    """Train the members: each fold stops one of them and chooses its start, the other folds train it.

    data: training set as the stage `filter` writes it, whose split has no say here; params: `hidden_nodes`
    (list), `starts`, `selected_hidden_nodes` (one of them, or "auto": chosen by `choose_size`), `seed`;
    clip_sigma: limit of the members' training targets, infinite for none. With fewer than five experiments
    there are as many folds.
    """
    points = whole_experiments(data)
    size, _ = choose_size(points, params, clip_sigma)
    number = min(FOLDS, data.sizes["experiment"])
    fold = folds(points.groups, number, params["seed"])
    members = []
    for stopping in (fold == member for member in range(number)):
        low, high = clip_limits(points.targets[~stopping].T[None], True, clip_sigma)
        regressor = NetworkRegressor(size, params["starts"], params["seed"]).fit(
            points.inputs[~stopping],
            np.clip(points.targets[~stopping], low, high),
            (points.inputs[stopping], points.targets[stopping]),
        )
        members.append(regressor.network_)
    return Ensemble(tuple(members))


def whole_experiments(data: xr.Dataset) -> Points:
    """All points of a training set, all of them to train with, in groups of experiments."""
    return read_points(data.assign(split=("experiment", [TRAINING] * data.sizes["experiment"])))
