"""The stage `filter`: from the data set to what the surrogate is trained on."""

import os
from collections.abc import Mapping

import numpy as np
import xarray as xr

from hopperopt.dataset import replicates
from hopperopt.files import InputError, read_netcdf, write_netcdf
from hopperopt.outflow import objective
from hopperopt.surrogate.features import OUTPUTS
from hopperopt.surrogate.split import TRAINING, split_experiments, split_points
from hopperopt.uncertainty import estimate, pooled_variance


def filter_targets(params: Mapping, dataset: str | os.PathLike, output: str | os.PathLike) -> None:
    """Average the replicates, split, clip the training targets; dataset.nc -> surrogate/training.nc.

    params: `factors` (names as keys), `clip_sigma` (None: no clip), `split` ("experiments" or "points"),
    `validation_experiments` and `test_experiments` (numbers of them), `seed`.
    dataset: path of the data set; output: path of training.nc.
    Experiments without a complete run are left out, and named in the attribute `left_out`. Raises
    files.InputError if none has one, or too few for the split.

    The clip (the paper's filter) cuts each output to its mean +- clip_sigma standard deviations over all
    training points. It moves training targets only: validation and test targets stay as simulated, and so do
    all objectives.
    """
    data = read_netcdf(dataset)
    factors = list(params["factors"])
    simulated = data["mass_fraction"].notnull().all(("size_class", "M")).any("replicate")
    left_out = [str(name) for name in data["experiment"].values[~simulated.values]]
    if not simulated.any():
        raise InputError("no experiment has a complete run: there is nothing to train a surrogate with")
    data = data.isel(experiment=simulated.values)
    targets = (
        data["mass_fraction"].sel(size_class=list(OUTPUTS)).mean("replicate").rename(size_class="output")
    ).transpose("experiment", "output", "M")
    labels = _labels(params, data, factors)
    training = _training_points(labels, targets)
    low, high = clip_limits(targets.values, training, params["clip_sigma"])
    within = np.clip(targets.values, low[:, None], high[:, None])
    clipped = np.where(training, within, targets.values)
    result = _training_set(data, targets.values, clipped, (low, high), labels).assign_coords(
        {name: data[name] for name in factors}
    )
    result.attrs |= {
        "factors": " ".join(factors),
        "split_by": params["split"],
        "seed": params["seed"],
        "clip_sigma": np.inf if params["clip_sigma"] is None else params["clip_sigma"],
        "left_out": " ".join(left_out),
    }
    result = _with_objectives(result, within)
    result["U"] = _corrected_squares(data)
    result = result.assign(_noise(data))
    write_netcdf(result, output)


def clip_limits(
    targets: np.ndarray, training: np.ndarray | bool, sigma: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the clip: mean -+ sigma standard deviations over the training points, per output.

    targets: (n, outputs, m); training: mask that broadcasts to it; sigma: None for no clip.
    Returns the lower and the upper limits, (outputs,) each, infinite without a clip.
    """
    outputs = targets.shape[1]
    if sigma is None or np.isinf(sigma):
        return np.full(outputs, -np.inf), np.full(outputs, np.inf)
    used = np.where(training, targets, np.nan)
    mean = np.nanmean(used, axis=(0, 2))
    spread = np.nanstd(used, axis=(0, 2), ddof=1)
    return mean - sigma * spread, mean + sigma * spread


def _training_set(data, targets, clipped, limits, labels):
    """Dataset of targets (experiments, outputs, M), as simulated and clipped, the clip and the split."""
    dimensions = ("experiment", "output", "M")
    batch = data["target_fraction"].sel(size_class=list(OUTPUTS)).values
    moved = (clipped != targets).sum(axis=0)
    return xr.Dataset(
        {
            "target": (dimensions, targets, _described("simulated mass fraction, mean of the replicates")),
            "target_clipped": (dimensions, clipped, _described("target, clipped where it trains")),
            "clip_low": ("output", limits[0], _described("lower limit of the clip")),
            "clip_high": ("output", limits[1], _described("upper limit of the clip")),
            "moved": (dimensions[1:], moved, _described("number of training points moved by the clip")),
            "split": (("experiment", "M")[: labels.ndim], labels, {"long_name": "use of the data"}),
            "target_fraction": ("output", batch, _described("mass fraction in the batch")),
        },
        coords={"experiment": data["experiment"], "output": list(OUTPUTS), "M": data["M"]},
        attrs={"title": "targets of the surrogate"},
    )


def _labels(params, data, factors):
    """The split's labels, (experiments,) or (experiments, M)."""
    held_out = params["validation_experiments"], params["test_experiments"]
    if params["split"] == "experiments":
        designs = np.column_stack([data[name].values for name in factors])
        return split_experiments(designs, *held_out, params["seed"])
    if params["split"] == "points":
        # The shares that these experiments are of the plan.
        shape = data.sizes["experiment"], data.sizes["M"]
        if sum(held_out) >= shape[0]:
            raise InputError(
                f"{shape[0]} experiments are too few: validation and test take the points of {sum(held_out)}"
            )
        return split_points(shape, *(count / shape[0] for count in held_out), params["seed"])
    raise InputError(f"split: {params['split']!r} is not allowed; allowed: experiments, points")


def _training_points(labels, targets):
    """Mask of the training points in the shape of the targets, (n, outputs, m)."""
    mask = labels == TRAINING
    mask = mask[:, None, None] if mask.ndim == 1 else mask[:, None, :]
    return np.broadcast_to(mask, targets.shape)


def _with_objectives(result, within):
    """Add J of every experiment, from its curve and from the curve cut to the limits whatever its use.

    The second is nothing to optimise: it shows how much of the objective a clipped data set would hide.
    """
    batch = result["target_fraction"].values
    for name, outflow, text in (
        ("J", result["target"].values, "rms departure of the mass fraction from the batch"),
        ("J_clipped", within, "the same if all curves were clipped"),
    ):
        values = objective(outflow, batch)
        result[name] = (("experiment", "output"), values, _described(text))
        result[f"{name}_max"] = ("output", values.max(axis=0), _described(f"largest {name}"))
        result[f"{name}_range"] = (
            "output",
            np.ptp(values, axis=0),
            _described(f"largest less smallest {name}"),
        )
    return result


def _corrected_squares(data):
    """U of each experiment's mean curve, (experiment, output)."""
    runs = replicates(data)
    U = estimate(runs, data["target_fraction"].values, pooled_variance(runs)).square[:, : len(OUTPUTS)]
    text = "objective squared of the mean curve, less its noise; may be negative"
    return ("experiment", "output"), U, _described(text)


def _noise(data):
    """Number of runs of each experiment, and the variance of their mean curve.

    Each experiment's own: the scatter between its runs, the counting variance where there is one alone.
    """
    runs, dimensions = replicates(data), ("experiment", "output", "M")
    variance = (runs.variance / runs.number)[:, : len(OUTPUTS)]
    return {
        "runs": ("experiment", runs.number[:, 0, 0], _described("number of runs that are data points")),
        "variance": (dimensions, variance, _described("variance of the target by its runs' noise")),
    }


def _described(text):
    return {"long_name": text, "units": "1"}
