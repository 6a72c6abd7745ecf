"""The stage `validate_fold`: one experiment predicted from all others, by every surrogate.

Everything is done without the experiment: the networks' size, their stop and their start, the components and
the hyperparameters of the processes.
"""

import os
from collections.abc import Mapping

import numpy as np
import xarray as xr

from hopperopt.files import read_netcdf, write_netcdf
from hopperopt.outflow import corrected_square, objective, signed_root
from hopperopt.surrogate import ensemble, features, gaussian, surface
from hopperopt.surrogate.network import Ensemble
from hopperopt.surrogate.prediction import Predictor
from hopperopt.surrogate.training import choose_size

CLIPPED = "_clipped"  # ends the names of networks whose training targets are clipped
BASELINE = "mean_objective"
DRAWS = 2000  # of what a simulation may show
QUANTILES = (0.05, 0.95)


def fold(params: Mapping, training: str | os.PathLike, output: str | os.PathLike) -> None:
    """Predict one experiment from all others; training.nc -> surrogate/validation/EXPERIMENT.nc.

    params: `experiment`, the one that is left out; `hidden_nodes` (list), `starts`, `selected_hidden_nodes`
    (one of them, or "auto": chosen without the experiment) and `seed` of the networks. An experiment without
    a complete run has nothing to be compared with, and an empty file.
    """
    data = read_netcdf(training)
    left_out = data["experiment"].values == params["experiment"]
    result = xr.Dataset()
    if left_out.any():
        own, others = data.isel(experiment=left_out), data.isel(experiment=~left_out)
        result = predict(others, _designs(own)[0], int(own["runs"].item()), params)
    title = {"title": "predictions of an experiment from the others", "experiment": params["experiment"]}
    write_netcdf(result.assign_attrs(title), output)


def predict(others: xr.Dataset, design: np.ndarray, runs: int, params: Mapping) -> xr.Dataset:
    """Predictions of every method for a design (factors,), from a training set that does not hold it.

    runs: number of runs whose mean curve will be compared. Returns, along `surrogate`: `curve` and its limits
    for such a mean curve, `J`, and limits of its U, all of 90 %; NaN for what a method does not predict.
    """
    rng = np.random.default_rng(params["seed"])
    noise, batch = gaussian.run_variance(others), others["target_fraction"].values
    found = {}
    for name, model in _models(others, params).items():
        predictor = Predictor((), others["M"].values, batch, model)
        draws = predictor.draws(design[None], DRAWS, rng)[:, 0]
        curves, J = predictor.predict(design[None])
        found[name] = curves[0], J[0], *_limits(draws, noise, runs, batch, rng)
    curve = others["target"].mean("experiment").transpose("output", "M").values
    draws = np.broadcast_to(curve, (DRAWS, *curve.shape))
    found["mean_curve"] = curve, objective(curve, batch), *_limits(draws, noise, runs, batch, rng)
    squares, none = others["U"].transpose("experiment", "output").values, np.full_like(curve, np.nan)
    for name, of_U in (
        ("quadratic", surface.quadratic(_designs(others), squares, design)),
        (BASELINE, surface.mean(squares)),
    ):
        found[name] = none, signed_root(of_U.value), (none, none), (of_U.low, of_U.high)
    return _dataset(found, others["M"])


def _models(others, params):
    """Surrogates of the curves by name; a single network is the ensemble's first member."""
    models, clip_sigma = {"gaussian": gaussian.fit(others)}, others.attrs["clip_sigma"]
    size, _ = choose_size(ensemble.whole_experiments(others), params, clip_sigma)
    for suffix, sigma in {"": np.inf, CLIPPED: clip_sigma}.items():
        if suffix and np.isinf(sigma):
            continue
        members = ensemble.fit(others, size, params["starts"], sigma, params["seed"])
        models[f"ensemble{suffix}"] = members
        models[f"network{suffix}"] = Ensemble(members.members[:1])
    return models


def _limits(draws, noise, runs, batch, rng):
    """Limits of 90 % for the mean curve of so many runs and for its U, with draws of the true curve."""
    return [np.quantile(part, QUANTILES, axis=0) for part in simulations(draws, noise, runs, batch, rng)]


def simulations(draws, noise, runs, batch, rng):
    """Mean curves of so many runs around draws (d, outputs, m), and their U (d, outputs).

    noise (outputs, m): variance of one run. The variance that U takes off is that between the runs, or for
    one run the counting variance, which is known.
    """
    variance = noise / runs
    seen = draws + np.sqrt(variance) * rng.normal(size=draws.shape)
    if runs > 1:
        variance = variance * rng.chisquare(runs - 1, size=draws.shape) / (runs - 1)
    return seen, corrected_square(seen, batch, variance)


def _dataset(found, M):
    """Dataset of predictions by method: curve, J, limits of the curve, limits of U."""
    along, per_M = ("surrogate", "output"), ("surrogate", "output", "M")
    curve, J, of_curve, of_U = (np.array(part) for part in zip(*found.values(), strict=True))
    return xr.Dataset(
        {
            "curve": (per_M, curve, _described("predicted mass fraction")),
            "curve_low": (per_M, of_curve[:, 0], _described("lower limit for the simulated mass fraction")),
            "curve_high": (per_M, of_curve[:, 1], _described("upper limit for the simulated mass fraction")),
            "J": (along, J, _described("predicted objective")),
            "U_low": (along, of_U[:, 0], _described("lower limit for the simulated U")),
            "U_high": (along, of_U[:, 1], _described("upper limit for the simulated U")),
        },
        coords={"surrogate": list(found), "output": list(features.OUTPUTS), "M": M},
    )


def _designs(data):
    return np.column_stack([data[name].values for name in data.attrs["factors"].split()])


def _described(text):
    return {"long_name": text, "units": "1"}
