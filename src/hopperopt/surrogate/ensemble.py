"""An ensemble of networks: the best start of each of five folds of whole experiments."""

import xarray as xr

from hopperopt.surrogate.estimator import NetworkRegressor
from hopperopt.surrogate.network import Ensemble
from hopperopt.surrogate.split import TRAINING, folds
from hopperopt.surrogate.training import FOLDS, Points, fit_clipped, read_points


def fit(data: xr.Dataset, hidden_nodes: int, starts: int, clip_sigma: float, seed: int) -> Ensemble:
    """Train the members: each fold stops one of them and chooses its start, the other folds train it.

    data: training set as the stage `filter` writes it, whose split has no say here; starts: initial weight
    sets for each member; clip_sigma: limit of the members' training targets, infinite for none. With fewer
    than five experiments there are as many folds.
    """
    points = whole_experiments(data)
    number = min(FOLDS, data.sizes["experiment"])
    fold = folds(points.groups, number, seed)
    members = []
    for stopping in (fold == member for member in range(number)):
        regressor = NetworkRegressor(hidden_nodes, starts, seed)
        fit_clipped(regressor, points, ~stopping, stopping, clip_sigma)
        members.append(regressor.network_)
    return Ensemble(tuple(members))


def whole_experiments(data: xr.Dataset) -> Points:
    """All points of a training set, all of them to train with, in groups of experiments."""
    return read_points(data.assign(split=("experiment", [TRAINING] * data.sizes["experiment"])))
