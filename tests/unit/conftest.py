"""Runs made without a simulation, as files like those that simulations write; curves of a known shape."""

from typing import ClassVar

import numpy as np
import pytest
import xarray as xr

from hopperopt import design as plans
from hopperopt import outflow


@pytest.fixture
def make_run():
    """Function that returns a run's dataset: well mixed outflow of `count` particles of each size."""

    def run(count=200, seed=0, status="complete", stayed=0, **scalars):
        rng = np.random.default_rng(seed)
        size_class = np.repeat([0, 1, 2], count).astype(np.int8)
        exit_time = rng.random(3 * count)
        exit_time[:stayed] = np.nan
        values = {
            "particle_count": 3 * count,
            "filling_level": 0.074,
            "filling_time": 1.0,
            "discharge_time": np.nanmax(exit_time),
            "discharge_rate": 0.3,
            "mass_flow_index": 0.5,
            "max_overlap": 0.1,
            "max_speed_ratio": 1.0,
            "lost_particles": 0,
            "max_energy_gain": 0.0,
            "residual_count": stayed,
            "residual_mass_fraction": stayed * 8 / (99 * count),
            **scalars,
        }
        units = {"filling_level": "m", "discharge_time": "s", "filling_time": "s", "discharge_rate": "kg s-1"}
        return xr.Dataset(
            {
                "exit_time": ("particle", exit_time, {"units": "s"}),
                "diameter": ("particle", np.array([2e-3, 3e-3, 4e-3])[size_class], {"units": "m"}),
                "size_class": ("particle", size_class),
                "position_opening": (("particle", "xyz"), rng.random((3 * count, 3)), {"units": "m"}),
                **{name: ((), value, {"units": units.get(name, "1")}) for name, value in values.items()},
                "status": ((), status),
            },
            attrs={"seed": seed},
        )

    return run


class Synthetic:
    """A hopper whose curves are known, smooth with a spike at the end, in the noise of single runs."""

    factors: ClassVar = {
        "theta_deg": [60, 57.5, 55, 52.5, 50],
        "length_mm": [50, 45, 40, 35, 30],
        "height_mm": [34, 32, 30, 28, 26],
    }
    batch = np.array([8, 27]) / 99
    noise = np.array([0.0065, 0.0177])
    designs = np.array([list(experiment.design.values()) for experiment in plans.l25(factors)])

    def anywhere(self, number, rng):
        """Designs (number, 3) within the ranges."""
        return rng.uniform(self.designs.min(axis=0), self.designs.max(axis=0), (number, 3))

    def curves(self, designs):
        """Mass fractions m_f and m_i, (n, 2, M)."""
        M = outflow.GRID
        theta, length, height = ((designs - [55, 40, 30]) / [5, 10, 4]).T[:, :, None]
        spike = np.exp(-(1 - M) / 0.03)
        fine = 0.01 * (length + 0.3 * theta) * np.sin(3 * M) + (0.03 - 0.05 * length + 0.01 * height) * spike
        intermediate = (
            0.02 * length * np.cos(3 * M) + (0.05 * length + 0.02 * theta**2) * spike - 0.01 * height
        )
        return self.batch[:, None] + np.stack([fine + 0.004 * height * np.cos(4 * M), intermediate], axis=1)

    def training(self, runs, seed=0, effect=1.0):
        """A training set of the plan, as the stage `filter` writes it, with the mean curves of so many runs.

        effect: 1, or less for curves that depend less on the design.
        """
        rng = np.random.default_rng(seed)
        truth = self.curves(self.designs)
        truth = truth.mean(axis=0) + effect * (truth - truth.mean(axis=0))
        shape = len(truth), runs, *truth.shape[1:]
        each = truth[:, None] + self.noise[:, None] * rng.normal(size=shape)
        mean, noise = each.mean(axis=1), np.broadcast_to(self.noise[:, None] ** 2, truth.shape)
        variance = (each.var(axis=1, ddof=1) if runs > 1 else noise) / runs
        return xr.Dataset(
            {
                "target": (("experiment", "output", "M"), mean),
                "variance": (("experiment", "output", "M"), variance),
                "runs": ("experiment", np.full(len(truth), runs)),
                "U": (("experiment", "output"), outflow.corrected_square(mean, self.batch, variance)),
                "target_clipped": (("experiment", "output", "M"), mean),
                "split": ("experiment", ["training"] * 17 + ["validation"] * 4 + ["test"] * 4),
                "target_fraction": ("output", self.batch),
            },
            coords={
                "experiment": [f"exp_{number:02d}" for number in range(1, 26)],
                "output": ["fine", "intermediate"],
                "M": outflow.GRID,
                **{name: ("experiment", self.designs[:, k]) for k, name in enumerate(self.factors)},
            },
            attrs={"factors": " ".join(self.factors), "clip_sigma": 3.0},
        )


@pytest.fixture(scope="session")
def synthetic():
    """Curves of a known shape: see Synthetic."""
    return Synthetic()
