"""Runs made without a simulation, as files like those that simulations write."""

import numpy as np
import pytest
import xarray as xr


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
                **{name: ((), value, {"units": units.get(name, "1")}) for name, value in values.items()},
                "status": ((), status),
            },
            attrs={"seed": seed},
        )

    return run
