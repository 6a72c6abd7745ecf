"""Sobol' indices of a function with known ones, and of surrogates of known curves."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from sklearn.gaussian_process import GaussianProcessRegressor

from hopperopt import files, outflow, sensitivity
from hopperopt.surrogate import gaussian, prediction, process
from hopperopt.surrogate.network import Ensemble, Network, Scaling

COLUMNS = [
    "output",
    "factor",
    *(f"{kind}{end}" for kind in ("first", "total") for end in ("", "_low", "_high")),
]


def test_ishigamis_function_has_its_indices():
    """Ishigami and Homma (1990) with a = 7, b = 0.1; another output has the same in other units."""
    bounds = np.array([[-np.pi, np.pi]] * 3)
    x, y, z = sensitivity.saltelli_designs(bounds, 4096, np.random.default_rng(1)).T
    ishigami = np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)
    first, total = sensitivity.first_and_total(np.stack([ishigami, 3 - 0.01 * ishigami]), 3)
    for draw in range(2):
        np.testing.assert_allclose(first[draw], [0.3139, 0.4424, 0], atol=0.02)
        np.testing.assert_allclose(total[draw], [0.5576, 0.4424, 0.2437], atol=0.02)


def test_designs_fill_the_ranges():
    bounds = np.array([[50, 60], [30, 50]])
    designs = sensitivity.saltelli_designs(bounds, 64, np.random.default_rng(1))
    assert designs.shape == (256, 2)
    np.testing.assert_allclose(designs.mean(axis=0), [55, 40], rtol=0.01)
    assert (designs >= bounds[:, 0]).all() and (designs <= bounds[:, 1]).all()
    np.testing.assert_array_equal(sensitivity.first_and_total(np.ones((3, 256)), 2), np.zeros((2, 3, 2)))


@pytest.fixture
def run(tmp_path, synthetic, monkeypatch):
    """Function that runs the stage on a surrogate of the synthetic hopper; its table by output and factor.

    The discharge time of 3 runs falls with the length, a lone run is missing.
    """
    monkeypatch.setattr(sensitivity, "SAMPLES", 64)
    rng = np.random.default_rng(5)
    times = 1.3 - 0.01 * synthetic.designs[:, 1:2] + rng.normal(0, 0.01, (25, 3))
    times[4] = np.nan
    coordinates = {name: ("experiment", synthetic.designs[:, k]) for k, name in enumerate(synthetic.factors)}
    data = xr.Dataset({"discharge_time": (("experiment", "replicate"), times)}, coords=coordinates)
    files.write_netcdf(data, tmp_path / "dataset.nc")
    bounds = {name: [min(levels), max(levels)] for name, levels in synthetic.factors.items()}

    def stage(model, seed=1):
        predictor = prediction.Predictor(tuple(synthetic.factors), outflow.GRID, synthetic.batch, model)
        prediction.save(tmp_path / "model.nc", predictor, {}, {})
        inputs = tmp_path / "model.nc", tmp_path / "dataset.nc", tmp_path / "sobol.csv"
        sensitivity.sensitivity({"bounds": bounds, "seed": seed}, *inputs)
        table = files.read_table(tmp_path / "sobol.csv")
        assert list(table) == COLUMNS
        return table.set_index(["output", "factor"])

    return stage


def test_the_processes_find_what_the_curves_depend_on(run, synthetic):
    table = run(gaussian.fit(synthetic.training(3)))
    assert table.index.get_level_values("output").unique().tolist() == [
        "J_fine",
        "J_intermediate",
        "discharge_time",
    ]
    for kind in ("first", "total"):
        ends = table[[f"{kind}_low", kind, f"{kind}_high"]]
        assert (np.diff(ends, axis=1) > 0).all()
    bounds = np.array([[min(levels), max(levels)] for levels in synthetic.factors.values()])
    designs = sensitivity.saltelli_designs(bounds, 1024, np.random.default_rng(1))
    J = outflow.objective(synthetic.curves(designs), synthetic.batch)
    truth = np.stack([part.ravel() for part in sensitivity.first_and_total(J.T, 3)], axis=1)
    within = [
        (table[f"{kind}_low"][:6] - 0.1 < truth[:, column])
        & (truth[:, column] < table[f"{kind}_high"][:6] + 0.1)
        for column, kind in enumerate(("first", "total"))
    ]
    assert np.mean(within) == 1
    assert table.loc[("discharge_time", "length_mm"), "first_low"] > 0.8
    assert table.loc[("discharge_time", "theta_deg"), "total"] < 0.1


def test_what_no_component_holds_is_no_interaction(run, synthetic):
    """Noise of each design's own would raise the total index of every factor."""
    model = gaussian.fit(synthetic.training(3))
    plain, noisy = (run(replace(model, rest=np.float64(rest))) for rest in (0, 0.5))
    assert plain.equals(noisy)


def test_a_single_network_has_indices_without_intervals(run):
    """Its curves depend on the second factor alone."""
    hidden = np.array([[0, 1.0, 0, 0, 0.3]])
    inputs = Scaling(np.array([55, 40, 30, 0.5]), np.array([5, 10, 4, 0.5]))
    network = Network(
        hidden, np.array([[0.1, 0], [0.2, 0.1]]), inputs, Scaling(np.array([0.1, 0.3]), np.ones(2))
    )
    table = run(Ensemble((network,)))
    single = table.drop("discharge_time")
    np.testing.assert_allclose(single["total"].unstack("output").loc["length_mm"], 1, atol=0.05)
    np.testing.assert_allclose(
        single["total"].unstack("output").loc[["theta_deg", "height_mm"]], 0, atol=1e-9
    )
    assert single[["first_low", "first_high", "total_low", "total_high"]].isna().all(axis=None)
    assert table.loc["discharge_time"].notna().all(axis=None)
    assert table.equals(run(Ensemble((network,))))


def test_many_experiments_take_part_and_some_are_searched(synthetic, monkeypatch):
    """The search for a process' hyperparameters takes the cube of their number at each of its steps."""
    seen = []
    fit = GaussianProcessRegressor.fit

    def spy(self, inputs, scores):
        seen.append((self.optimizer is not None, len(inputs)))
        return fit(self, inputs, scores)

    monkeypatch.setattr(GaussianProcessRegressor, "fit", spy)
    monkeypatch.setattr(process, "SEARCHED", 13)
    data = xr.Dataset(
        {"discharge_time": (("experiment", "replicate"), 1.3 - 0.01 * synthetic.designs[:, 1:2])},
        coords={name: ("experiment", synthetic.designs[:, k]) for k, name in enumerate(synthetic.factors)},
    )
    bounds = np.array([[min(levels), max(levels)] for levels in synthetic.factors.values()])
    designs = synthetic.anywhere(10, np.random.default_rng(1))
    drawn = sensitivity.draw_times(data, list(synthetic.factors), bounds, designs, np.random.default_rng(1))
    assert seen == [(True, 13), (False, 25)]
    np.testing.assert_allclose(drawn.mean(axis=0), 1.3 - 0.01 * designs[:, 1], atol=0.01)
