"""The trained surrogate as a file, and as a function of the design."""

import os
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np
import xarray as xr

from hopperopt.files import InputError, read_netcdf, write_netcdf
from hopperopt.outflow import objective
from hopperopt.surrogate import features
from hopperopt.surrogate.gaussian import Gaussian
from hopperopt.surrogate.network import Ensemble, Network, Scaling


class Model(Protocol):
    """What every surrogate of the curves can do."""

    def moments(self, designs: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance, (n, outputs, m) each, of the curves without noise at designs (n, factors)."""

    def draws(self, designs: np.ndarray, M: np.ndarray, number: int, rng: np.random.Generator) -> np.ndarray:
        """Curves that may be the true ones, joint over the designs: (number, n, outputs, m)."""


class Predictor(NamedTuple):
    """Predicts outflow curves and objectives of designs."""

    factors: tuple[str, ...]
    M: np.ndarray  # (m,) discharged mass fractions at which curves are predicted
    batch: np.ndarray  # (outputs,) mass fractions in the batch, m_k0
    model: Model
    objective_error: np.ndarray | None = None  # (outputs,) rms error of J

    def curves(self, designs: np.ndarray) -> np.ndarray:
        """Mass fractions m_k(M), (n, outputs, m), of designs (n, factors) in the factors' order and units."""
        return self.predict(designs)[0]

    @property
    def knows_its_error(self) -> bool:
        """Whether draws differ: a single network has but one curve for a design."""
        return not isinstance(self.model, Ensemble) or len(self.model.members) > 1

    def draws(self, designs: np.ndarray, number: int, rng: np.random.Generator) -> np.ndarray:
        """Curves that may be the true ones, joint over the designs: (number, n, outputs, m)."""
        return self.model.draws(designs, self.M, number, rng)

    def objectives(self, designs: np.ndarray) -> np.ndarray:
        """J_k of designs (n, factors): (n, outputs), sqrt(E[J^2]) over what the curves may be."""
        return self.predict(designs)[1]

    def predict(self, designs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Curves (n, outputs, m) and J_k (n, outputs) of designs (n, factors), at the cost of one of them.

        E[J^2] is the square of the mean curve's J and the variance of the curves, averaged over M; of a
        single network it is the plain J^2 of its curve.
        """
        mean, variance = self.model.moments(designs, self.M)
        return mean, np.sqrt(objective(mean, self.batch) ** 2 + variance.mean(axis=-1))

    def array(self, design: Mapping[str, float]) -> np.ndarray:
        """A design {factor: value} as an array (1, factors). Raises files.InputError for other names."""
        if set(design) != set(self.factors):
            raise InputError(f"a design needs the factors {', '.join(self.factors)}, not {', '.join(design)}")
        return np.array([[float(design[name]) for name in self.factors]])


def save(path: str | os.PathLike, predictor: Predictor, additions: Mapping, attributes: Mapping) -> None:
    """Write a surrogate: the predictor, further variables (the clip's limits, the split) and attributes."""
    variables: Callable = _gaussian if isinstance(predictor.model, Gaussian) else _networks
    units = {"long_name": "mass fraction in the batch", "units": "1"}
    result = xr.Dataset(
        {
            **variables(predictor.model),
            "target_fraction": ("output", predictor.batch, units),
            **additions,
        },
        coords={
            "factor": list(predictor.factors),
            "output": list(features.OUTPUTS),
            "M": ("M", predictor.M, {"long_name": "discharged mass fraction", "units": "1"}),
        },
        attrs=attributes,
    )
    if predictor.objective_error is not None:
        units = {"long_name": "rms error of the predicted J", "units": "1"}
        result["objective_error"] = ("output", predictor.objective_error, units)
    write_netcdf(result, path)


def load(path: str | os.PathLike) -> Predictor:
    """Read a surrogate of any kind as a Predictor."""
    data = read_netcdf(path)
    return Predictor(
        tuple(map(str, data["factor"].values)),
        data["M"].values,
        data["target_fraction"].values,
        _read_gaussian(data) if "scores" in data else _read_networks(data),
        data["objective_error"].values if "objective_error" in data else None,
    )


def _networks(ensemble: Ensemble) -> dict[str, tuple]:
    """Variables of an ensemble; `input` are the factors and M, all members have the same hidden size."""
    names = ("hidden", "output", "inputs_scaling", "outputs_scaling")
    hidden, output, inputs, outputs = (
        np.stack([getattr(member, name) for member in ensemble.members]) for name in names
    )
    described = {
        "hidden_weights": ("hidden input", hidden[..., :-1], "weights of hidden nodes"),
        "hidden_bias": ("hidden", hidden[..., -1], "bias of hidden nodes"),
        "output_weights": ("output hidden", output[..., :-1], "weights of outputs"),
        "output_bias": ("output", output[..., -1], "bias of outputs"),
        "input_centre": ("input", inputs[:, 0], "subtracted from an input"),
        "input_scale": ("input", inputs[:, 1], "divides an input"),
        "output_centre": ("output", outputs[:, 0], "added to a scaled output"),
        "output_scale": ("output", outputs[:, 1], "multiplies a scaled output"),
    }
    return {
        name: (("member", *dimensions.split()), values, {"long_name": text})
        for name, (dimensions, values, text) in described.items()
    }


def _read_networks(data: xr.Dataset) -> Ensemble:
    members = [data.isel(member=member) for member in range(data.sizes["member"])]
    return Ensemble(
        tuple(
            Network(
                np.column_stack([one["hidden_weights"].transpose("hidden", "input"), one["hidden_bias"]]),
                np.column_stack([one["output_weights"].transpose("output", "hidden"), one["output_bias"]]),
                Scaling(one["input_centre"].values, one["input_scale"].values),
                Scaling(one["output_centre"].values, one["output_scale"].values),
            )
            for one in members
        )
    )


# Field of Gaussian: its dimensions in the file and what it is; those without M have the size 1 there.
GAUSSIAN = {
    "designs": ("experiment factor", "designs of the training experiments, in the factors' units"),
    "noise": ("experiment", "variance of the noise in a score"),
    "scale": ("output M", "noise of a single run"),
    "mean": ("output M", "mean curve of the training experiments"),
    "mean_variance": ("output one", "variance of the mean curve, in squares of the scale"),
    "components": ("component output M", "principal components of the curves"),
    "component_variances": ("component output one", "variance of the components, in squares of the scale"),
    "rest": ("", "variance of what no component holds, in squares of the scale"),
    "scores": ("experiment component", "scores of the training experiments"),
    "variances": ("component", "variance of the process of a score"),
    "lengths": ("component factor", "correlation length, in half ranges of the factor"),
}


def _gaussian(model: Gaussian) -> dict[str, tuple]:
    return {
        name: (dimensions.split(), getattr(model, name), {"long_name": text})
        for name, (dimensions, text) in GAUSSIAN.items()
    }


def _read_gaussian(data: xr.Dataset) -> Gaussian:
    return Gaussian(
        **{name: data[name].transpose(*dims.split()).values for name, (dims, _) in GAUSSIAN.items()}
    )
