"""The stage `sensitivity`: Sobol' indices of what the surrogate predicts, over the ranges of the factors.

First-order indices are shares of an output's variance that a factor explains alone, total ones what would be
left of it were all other factors known (Saltelli et al., Computer Physics Communications 181, 2010, 259-270).
They are indices of the surrogate: of each of many draws of what it says the outputs may be, so that their
spread tells how well they are known.
"""

import dataclasses
import os
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr
from scipy.stats import qmc, sobol_indices
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from hopperopt import files
from hopperopt.outflow import objective
from hopperopt.surrogate import gaussian, prediction, process
from hopperopt.surrogate.features import OUTPUTS
from hopperopt.surrogate.network import one_thread

SAMPLES = 256  # a power of two; each takes as many designs as there are factors, and two
DRAWS = 200
TIME = "discharge_time"
LIMITS = {"": 0.5, "_low": 0.05, "_high": 0.95}  # quantiles of the draws: the value and its interval of 90 %


def sensitivity(
    params: Mapping, surrogate: str | os.PathLike, dataset: str | os.PathLike, output: str | os.PathLike
) -> None:
    """Write sobol.csv: a row per output and factor, first and total index with intervals of 90 %.

    params: `bounds` {factor: [low, high]} in the factors' own units; `seed`. surrogate, dataset: paths of
    model.nc, for J, and of dataset.nc, for the discharge time, which has a Gaussian process of its own.
    Intervals are of the surrogate's draws; a single network, which has none, has no interval.
    """
    predictor, data = _smooth(prediction.load(surrogate)), files.read_netcdf(dataset)
    bounds = np.array([params["bounds"][name] for name in predictor.factors], dtype=float)
    rng = np.random.default_rng(params["seed"])
    designs = saltelli_designs(bounds, SAMPLES, rng)
    known = predictor.knows_its_error
    J = objective(predictor.draws(designs, DRAWS if known else 1, rng), predictor.batch)
    values = {f"J_{name}": J[..., column] for column, name in enumerate(OUTPUTS)}
    values[TIME] = draw_times(data, predictor.factors, bounds, designs, rng)
    tables = [
        _table(predictor.factors, *first_and_total(drawn, len(bounds)), len(drawn) > 1).assign(output=name)
        for name, drawn in values.items()
    ]
    table = pd.concat(tables)
    files.write_table(table[["output", *table.columns.drop("output")]], output)


def _smooth(predictor: prediction.Predictor) -> prediction.Predictor:
    """Without what no component of Gaussian processes holds: noise of every design's own would look like an
    interaction of all factors.
    """
    if not isinstance(predictor.model, gaussian.Gaussian):
        return predictor
    return predictor._replace(model=dataclasses.replace(predictor.model, rest=np.zeros(())))


def saltelli_designs(bounds: np.ndarray, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Designs at which outputs are needed: samples A and B, and A with each factor in turn from B.

    bounds: (factors, 2). Returns (samples (factors + 2), factors).
    """
    low, high = bounds.T
    unit = qmc.Sobol(2 * len(bounds), rng=rng).random(samples)
    A, B = np.split(unit, 2, axis=1)
    mixed = [np.where(np.arange(len(bounds)) == factor, B, A) for factor in range(len(bounds))]
    return low + np.concatenate([A, B, *mixed]) * (high - low)


def first_and_total(values: np.ndarray, factors: int) -> tuple[np.ndarray, np.ndarray]:
    """First-order and total indices, (draws, factors) each, of outputs (draws, n) at `saltelli_designs`.

    0 for an output that is the same everywhere.
    """
    parts = np.split(values, factors + 2, axis=1)
    outputs = {"f_A": parts[0], "f_B": parts[1], "f_AB": np.stack(parts[2:])}
    found = sobol_indices(func=outputs, n=parts[0].shape[1])
    shape = len(values), factors
    return np.reshape(found.first_order, shape), np.reshape(found.total_order, shape)


@one_thread
def draw_times(
    data: xr.Dataset, factors, bounds: np.ndarray, designs: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Draws of a Gaussian process of the plan's discharge times without their noise, (DRAWS, n), s.

    data: the plan's data set, of which designs without a run are left out; bounds: (factors, 2); designs:
    (n, factors). The noise's variance is a parameter of the process.
    """
    times = data[TIME].mean("replicate").values
    usable = np.isfinite(times)
    centre, half = bounds.mean(axis=1), np.ptp(bounds, axis=1) / 2
    trained = (np.column_stack([data[name].values for name in factors])[usable] - centre) / half
    mean, scale = times[usable].mean(), times[usable].std() or 1.0
    scores = (times[usable] - mean) / scale
    kernel = ConstantKernel() * Matern(np.ones(len(factors)), gaussian.LENGTHS, nu=2.5) + WhiteKernel(0.1)
    fitted = process.likeliest(kernel, trained, scores)
    noise = np.full(len(scores), fitted.k2.noise_level)
    known = process.conditioned(fitted.k1, trained, scores, noise)
    curve, covariance = known.predict((designs - centre) / half, return_cov=True)
    return mean + scale * rng.multivariate_normal(curve, covariance, DRAWS, method="eigh")


def _table(factors, first, total, known):
    """A row per factor from indices (draws, factors); intervals only where the draws' spread is known."""
    table = pd.DataFrame({"factor": list(factors)})
    for name, draws in (("first", first), ("total", total)):
        for end, level in LIMITS.items():
            table[name + end] = np.quantile(draws, level, axis=0) if known or not end else np.nan
    return table
