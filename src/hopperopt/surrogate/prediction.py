"""The trained surrogate as a file, and as a function of the design."""

import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from hopperopt.files import InputError, read_netcdf, write_netcdf
from hopperopt.outflow import objective
from hopperopt.surrogate import features
from hopperopt.surrogate.network import Network, Scaling


class Predictor(NamedTuple):
    """Predicts outflow curves and objectives of designs."""

    factors: tuple[str, ...]
    M: np.ndarray  # (m,) discharged mass fractions at which curves are predicted
    batch: np.ndarray  # (outputs,) mass fractions in the batch, m_k0
    network: Network
    objective_error: np.ndarray | None = None  # (outputs,) rms error of J, see `training`

    def curves(self, designs: np.ndarray) -> np.ndarray:
        """Mass fractions m_k(M), (n, outputs, m), of designs (n, factors) in the factors' order and units."""
        return features.curves(self.network.predict(features.rows(designs, self.M)), len(self.M))

    def objectives(self, designs: np.ndarray) -> np.ndarray:
        """J_k of designs (n, factors): (n, outputs), from the plain predicted curves."""
        return objective(self.curves(designs), self.batch)

    def array(self, design: Mapping[str, float]) -> np.ndarray:
        """A design {factor: value} as an array (1, factors). Raises files.InputError for other names."""
        if set(design) != set(self.factors):
            raise InputError(f"a design needs the factors {', '.join(self.factors)}, not {', '.join(design)}")
        return np.array([[float(design[name]) for name in self.factors]])


def save(path: str | os.PathLike, predictor: Predictor, additions: Mapping, attributes: Mapping) -> None:
    """Write network.nc: the predictor, further variables (the clip's limits, the split) and attributes."""
    network = predictor.network
    if predictor.objective_error is not None:
        text = "rms departure of the predicted J from the simulated, noise-corrected one"
        described = {"long_name": text, "units": "1"}
        additions = {**additions, "objective_error": ("output", predictor.objective_error, described)}
    result = xr.Dataset(
        {
            "hidden_weights": (
                ("hidden", "input"),
                network.hidden[:, :-1],
                {"long_name": "weights of hidden nodes"},
            ),
            "hidden_bias": ("hidden", network.hidden[:, -1], {"long_name": "bias of hidden nodes"}),
            "output_weights": (
                ("output", "hidden"),
                network.output[:, :-1],
                {"long_name": "weights of outputs"},
            ),
            "output_bias": ("output", network.output[:, -1], {"long_name": "bias of outputs"}),
            "input_centre": (
                "input",
                network.inputs_scaling.centre,
                {"long_name": "subtracted from an input"},
            ),
            "input_scale": ("input", network.inputs_scaling.scale, {"long_name": "divides an input"}),
            "output_centre": (
                "output",
                network.outputs_scaling.centre,
                {"long_name": "added to a scaled output"},
            ),
            "output_scale": (
                "output",
                network.outputs_scaling.scale,
                {"long_name": "multiplies a scaled output"},
            ),
            "target_fraction": (
                "output",
                predictor.batch,
                {"long_name": "mass fraction in the batch", "units": "1"},
            ),
            **additions,
        },
        coords={
            "input": [*predictor.factors, "M"],
            "output": list(features.OUTPUTS),
            "M": ("M", predictor.M, {"long_name": "discharged mass fraction", "units": "1"}),
        },
        attrs=attributes,
    )
    write_netcdf(result, path)


def load(path: str | os.PathLike) -> Predictor:
    """Read network.nc as a Predictor."""
    data = read_netcdf(path)
    network = Network(
        np.column_stack([data["hidden_weights"].transpose("hidden", "input"), data["hidden_bias"]]),
        np.column_stack([data["output_weights"].transpose("output", "hidden"), data["output_bias"]]),
        Scaling(data["input_centre"].values, data["input_scale"].values),
        Scaling(data["output_centre"].values, data["output_scale"].values),
    )
    factors = tuple(str(name) for name in data["input"].values[:-1])
    error = data["objective_error"].values if "objective_error" in data else None
    return Predictor(factors, data["M"].values, data["target_fraction"].values, network, error)
