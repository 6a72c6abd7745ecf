"""The stage `validate`: all surrogates compared at experiments that they have not seen.

What is predicted for an experiment (see `folds`) is compared with its simulation: curves with the mean curve
of its runs, never clipped, and J with sign(U) sqrt|U|.
"""

import logging
import os
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
import xarray as xr

from hopperopt.files import read_netcdf, write_netcdf, write_table
from hopperopt.outflow import signed_root
from hopperopt.surrogate import gaussian
from hopperopt.surrogate.estimator import NetworkRegressor
from hopperopt.surrogate.folds import BASELINE, CLIPPED, DRAWS, QUANTILES, simulations
from hopperopt.surrogate.split import TEST, TRAINING, VALIDATION, split_points
from hopperopt.surrogate.training import choose_size, fit_clipped, read_points

METHODS = (
    "network", f"network{CLIPPED}", "ensemble", f"ensemble{CLIPPED}", "gaussian", "quadratic",
    "mean_curve", BASELINE, "noise_floor", "random_points",
)  # fmt: skip
RESAMPLES = 2000  # of the experiments, for the interval of the coverage
# An interval of 90 % is called miscalibrated where so few hits are less likely than this: below 19 of 25.
RARE = 0.01

log = logging.getLogger(__name__)


def validate(
    params: Mapping,
    training: str | os.PathLike,
    folds: Iterable[str | os.PathLike],
    table: str | os.PathLike,
    output: str | os.PathLike,
) -> None:
    """Compare the methods: surrogate/validation.csv, and all predictions in one file, validation.nc.

    params: as in `folds.fold`, for the paper's split of single points. training: path of training.nc; folds:
    those of the folds' files. The log says of each method with intervals of U whether these are consistent.
    """
    data = read_netcdf(training)
    predicted = join(map(read_netcdf, folds), data)
    rows = score(predicted, data)
    compared = data.sel(experiment=predicted["experiment"].values)
    rows["noise_floor"] = noise_floor(compared, np.random.default_rng(params["seed"]))
    rows["random_points"] = random_points(data, params)
    write_table(pd.DataFrame([{"method": name, **rows[name]} for name in METHODS if name in rows]), table)
    write_netcdf(predicted.assign(_coverage_limits(predicted, params["seed"])), output)
    number = predicted.sizes["experiment"]
    for name, row in rows.items():
        hits = [row.get(f"coverage_{k}_hits", np.nan) for k in "fi"]
        if np.isfinite(hits).all():
            word = "consistent" if min(hits) >= least_hits(number) else "miscalibrated"
            log.info(
                f"{name}: U of {hits[0]:.0f} and {hits[1]:.0f} of {number} experiments in its limits: {word}"
            )


def least_hits(number: int) -> int:
    """Hits of so many experiments with which intervals of 90 % are consistent."""
    from scipy.stats import binom  # slow to import

    return int(binom.ppf(RARE, number, 0.9))


def join(folds: Iterable[xr.Dataset], data: xr.Dataset) -> xr.Dataset:
    """Predictions along `experiment`, as in the training set, what was simulated, which limits hold.

    An experiment of the training set that has no fold is left out.
    """
    named = {fold.attrs["experiment"]: fold for fold in folds}
    names = [name for name in map(str, data["experiment"].values) if name in named]
    data = data.sel(experiment=names)
    predicted = xr.concat([named[name].drop_attrs(deep=False) for name in names], "experiment", join="exact")
    predicted = predicted.assign_coords(experiment=names).assign(
        target=data["target"].drop_vars(data.attrs["factors"].split()),
        simulated_J=(
            ("experiment", "output"),
            signed_root(data["U"].transpose("experiment", "output").values),
        ),
        U=data["U"].drop_vars(data.attrs["factors"].split()),
    )
    predicted.attrs["title"] = "experiments predicted from all others"
    return predicted.assign(
        within=_within(predicted, "target", "curve"), U_within=_within(predicted, "U", "U")
    )


def score(predicted: xr.Dataset, data: xr.Dataset) -> dict[str, dict[str, float]]:
    """A row of the table for each method of the folds; predicted as `join` returns it."""
    rows = {}
    for name in predicted["surrogate"].values:
        one = predicted.sel(surrogate=name)
        squares = ((one["curve"] - one["target"]) ** 2).mean("experiment").mean("M").values
        error = np.sqrt(((one["J"] - one["simulated_J"]) ** 2).mean("experiment").values)
        rows[str(name)] = _row(squares, error) | {
            "coverage_90": float(one["within"].mean()),
            **{f"coverage_{k}_hits": hits for k, hits in zip("fi", _hits(one["U_within"]), strict=True)},
        }
    return rows


def noise_floor(data: xr.Dataset, rng: np.random.Generator) -> dict[str, float]:
    """The row of a perfect predictor: what it misses is the noise of the simulations alone.

    Of the curves that is the variance of the mean curves. For J each experiment is simulated again many times
    around its curve. The true J^2 are the U drawn together to the spread that they have without noise, and
    not below 0; the curve's departure from the batch, where noise has its part, is scaled to them.
    """
    target, variance, U = (
        data[name].transpose("experiment", "output", ...).values for name in ("target", "variance", "U")
    )
    noise, batch = gaussian.run_variance(data), data["target_fraction"].values

    def deviations(departure):
        """Of U from the mean square of departures (experiments, outputs, m): (experiments, draws, 2)."""
        found = []
        for own, runs in zip(departure, data["runs"].values, strict=True):
            draws = np.broadcast_to(batch[:, None] + own, (DRAWS, *own.shape))
            found.append(simulations(draws, noise, runs, batch, rng)[1] - np.mean(own**2, axis=-1))
        return np.array(found)

    departure = np.sqrt(np.maximum((target - batch[:, None]) ** 2 - variance, 0))
    mean, tiny = U.mean(axis=0), np.finfo(float).tiny
    noisy = np.mean(deviations(departure) ** 2, axis=(0, 1)) / np.maximum(U.var(axis=0), tiny)
    true = np.maximum(mean + np.sqrt(np.maximum(1 - noisy, 0)) * (U - mean), 0)
    scale = np.sqrt(true / np.maximum(np.mean(departure**2, axis=-1), tiny))
    true = true[:, None]
    errors = signed_root(true + deviations(departure * scale[..., None])) - np.sqrt(true)
    return _row(variance.mean(axis=(0, 2)), np.sqrt(np.mean(errors**2, axis=(0, 1))))


def random_points(data: xr.Dataset, params: Mapping) -> dict[str, float]:
    """The row of the paper's split: single points of all curves are held out, and their neighbours train.

    The shares of points are those of the training set's split. It has no say on curves of new designs.
    """
    shape = data.sizes["experiment"], data.sizes["M"]
    stopping_share, test_share = (float((data["split"] == use).mean()) for use in (VALIDATION, TEST))
    labels = split_points(shape, stopping_share, test_share, params["seed"])
    points = read_points(data.assign(split=(("experiment", "M"), labels)))
    size, _ = choose_size(points, params, data.attrs["clip_sigma"])
    trained, stopping, test = (points.use == use for use in (TRAINING, VALIDATION, TEST))
    regressor = NetworkRegressor(size, params["starts"], params["seed"])
    fit_clipped(regressor, points, trained, stopping, data.attrs["clip_sigma"])
    squares = (regressor.predict(points.inputs[test]) - points.targets[test]) ** 2
    return _row(squares.mean(axis=0), np.full(squares.shape[1], np.nan))


def _within(predicted, simulated, name):
    """1 where a simulation lies in its limits, 0 where not, NaN without limits."""
    low, high = predicted[f"{name}_low"], predicted[f"{name}_high"]
    inside = ((low <= predicted[simulated]) & (predicted[simulated] <= high)).astype(float)
    return inside.where(low.notnull()).assign_attrs(long_name=f"whether {simulated} lies in its limits")


def _hits(within):
    """Number of experiments inside the limits, per output; NaN without limits."""
    return within.sum("experiment", skipna=False).values


def _coverage_limits(predicted, seed):
    """Limits of 90 % for each method's coverage, from experiments drawn again."""
    covered = predicted["within"].mean(("output", "M")).transpose("experiment", "surrogate").values
    rng = np.random.default_rng(seed)
    drawn = covered[rng.integers(len(covered), size=(RESAMPLES, len(covered)))].mean(axis=1)
    limits = np.quantile(drawn, QUANTILES, axis=0)
    text = "limit of the coverage of the mean curves, experiments drawn again"
    return {
        f"coverage_{name}": ("surrogate", values, _described(text))
        for name, values in zip(("low", "high"), limits, strict=True)
    }


def _row(squares, error):
    """Errors of a method: mean squared error of the curves (outputs,), rms error of J (outputs,)."""
    return {
        "curve_rmse": np.sqrt(np.mean(squares)),
        **{f"curve_rmse_{k}": value for k, value in zip("fi", np.sqrt(squares), strict=True)},
        **{f"objective_{k}_rmse": value for k, value in zip("fi", error, strict=True)},
    }


def _described(text):
    return {"long_name": text, "units": "1"}
