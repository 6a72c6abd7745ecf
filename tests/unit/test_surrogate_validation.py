"""The comparison of the surrogates on curves of a known shape, with noise of a known size."""

import numpy as np
import pytest
import xarray as xr

from hopperopt import files
from hopperopt.outflow import objective
from hopperopt.surrogate import folds, surface, validation

PARAMS = {"hidden_nodes": [2], "selected_hidden_nodes": 2, "starts": 1, "seed": 1}
CURVES = ["curve_rmse", "curve_rmse_f", "curve_rmse_i"]
OBJECTIVES = ["objective_f_rmse", "objective_i_rmse"]
COLUMNS = ["method", *CURVES, *OBJECTIVES, "coverage_90", "coverage_f_hits", "coverage_i_hits"]


@pytest.fixture(scope="module")
def compared(synthetic, tmp_path_factory):
    """A training set of three runs each, the table and the predictions of the stages."""
    folder, data = tmp_path_factory.mktemp("validation"), synthetic.training(3)
    files.write_netcdf(data, folder / "training.nc")
    parts = []
    for name in data["experiment"].values:
        parts.append(folder / f"{name}.nc")
        folds.fold(PARAMS | {"experiment": str(name)}, folder / "training.nc", parts[-1])
    outputs = folder / "validation.csv", folder / "validation.nc"
    validation.validate(PARAMS, folder / "training.nc", parts, *outputs)
    return data, files.read_table(outputs[0]), files.read_netcdf(outputs[1])


def test_every_method_has_a_row_with_what_it_predicts(compared):
    _, table, _ = compared
    assert list(table) == COLUMNS and tuple(table["method"]) == validation.METHODS
    table = table.set_index("method")
    curves = table["curve_rmse"].notna()
    assert set(table.index[~curves]) == {"quadratic", "mean_objective"}
    assert set(table.index[table["objective_f_rmse"].isna()]) == {"random_points"}
    assert table.loc["gaussian"].notna().all()


def test_errors_are_those_against_the_mean_curves_and_signed_roots(compared, synthetic):
    data, table, predicted = compared
    row, one = table.set_index("method").loc["ensemble"], predicted.sel(surrogate="ensemble")
    squares = (one["curve"].values - data["target"].values) ** 2
    assert row["curve_rmse"] == pytest.approx(np.sqrt(squares.mean()), rel=1e-8)
    assert row["curve_rmse_i"] == pytest.approx(np.sqrt(squares[:, 1].mean()), rel=1e-8)
    J = np.sign(data["U"]) * np.sqrt(np.abs(data["U"]))
    errors = np.sqrt(np.mean((one["J"].values - J.values) ** 2, axis=0))
    np.testing.assert_allclose(row[OBJECTIVES].astype(float), errors, rtol=1e-8)


def test_the_mean_knows_its_neighbours_alone(compared):
    data, _, predicted = compared
    first = predicted.isel(experiment=0)
    others = data.isel(experiment=slice(1, None))
    np.testing.assert_allclose(
        first["curve"].sel(surrogate="mean_curve"), others["target"].mean("experiment")
    )
    mean = others["U"].mean("experiment")
    np.testing.assert_allclose(first["J"].sel(surrogate="mean_objective") ** 2, mean, rtol=1e-12)


def test_a_surrogate_of_real_effects_lies_between_the_floor_and_the_mean(compared):
    table = compared[1].set_index("method")
    for column in ("curve_rmse", "objective_f_rmse"):
        mean = table.loc["mean_curve" if column == "curve_rmse" else "mean_objective", column]
        assert table.loc["noise_floor", column] < table.loc["gaussian", column] < 0.8 * mean


def test_intervals_of_the_processes_are_consistent(compared, caplog):
    _, table, predicted = compared
    row = table.set_index("method").loc["gaussian"]
    assert 0.85 < row["coverage_90"] < 0.95
    assert row["coverage_f_hits"] >= 19 and row["coverage_i_hits"] >= 19
    limits = predicted[["coverage_low", "coverage_high"]].sel(surrogate="gaussian")
    assert limits["coverage_low"] < row["coverage_90"] < limits["coverage_high"]
    # A single network is sure of itself, and wrong.
    assert table.set_index("method").loc["mean_curve", "coverage_90"] < 0.7


def test_below_19_of_25_is_miscalibrated():
    assert validation.least_hits(25) == 19


@pytest.mark.parametrize("runs", [1, 3])
def test_what_is_held_out_changes_no_prediction_of_it(synthetic, tmp_path, runs):
    """Its curve, its noise, its use in the split and its U: a method that peeks at any would be seen."""
    data = synthetic.training(runs)
    results = []
    for change in (0.0, 0.3):
        held_out = data["experiment"] == "exp_13"
        changed = data.assign({name: data[name] + held_out * change for name in ("target", "variance", "U")})
        changed["target_clipped"] = changed["target"]
        changed["split"] = changed["split"].where(~(held_out & (change > 0)), "test")
        files.write_netcdf(changed, tmp_path / "training.nc")
        for name in ("exp_13", "exp_12"):
            folds.fold(PARAMS | {"experiment": name}, tmp_path / "training.nc", tmp_path / "fold.nc")
            results.append(files.read_netcdf(tmp_path / "fold.nc"))
    own, other, own_after, other_after = results
    xr.testing.assert_equal(own, own_after)
    # The change is one that the predictions of the others show.
    assert (np.abs(other_after["J"] - other["J"]).max("output") > 1e-4).all()


@pytest.mark.parametrize("runs", [1, 3])
def test_noise_floor_is_what_the_true_curves_miss(synthetic, runs):
    J, missed, floors = objective(synthetic.curves(synthetic.designs), synthetic.batch), [], []
    for seed in range(10):
        data = synthetic.training(runs, seed)
        simulated = np.sign(data["U"].values) * np.sqrt(np.abs(data["U"].values))
        missed.append(np.sqrt(np.mean((simulated - J) ** 2, axis=0)))
        floors.append(validation.noise_floor(data, np.random.default_rng(seed)))
    floor = [np.mean([row[name] for row in floors]) for name in OBJECTIVES]
    np.testing.assert_allclose(floor, np.mean(missed, axis=0), rtol=0.15)
    both = np.sqrt(np.mean(synthetic.noise**2) / runs)
    assert np.mean([row["curve_rmse"] for row in floors]) == pytest.approx(both, rel=0.03)


def test_experiments_without_a_complete_run_are_left_out(compared, tmp_path):
    data, _, predicted = compared
    files.write_netcdf(data.isel(experiment=slice(0, 24)), tmp_path / "training.nc")
    folds.fold(PARAMS | {"experiment": "exp_25"}, tmp_path / "training.nc", tmp_path / "exp_25.nc")
    empty = files.read_netcdf(tmp_path / "exp_25.nc")
    some = [predicted.isel(experiment=k).drop_vars("experiment") for k in range(24)]
    named = [part.assign_attrs(experiment=f"exp_{k + 1:02d}") for k, part in enumerate(some)]
    joined = validation.join([empty, *named], files.read_netcdf(tmp_path / "training.nc"))
    assert joined.sizes["experiment"] == 24


def test_folds_of_some_experiments_are_compared_with_these(compared):
    data, _, predicted = compared
    names = [str(name) for name in data["experiment"].values[::3]]
    parts = predicted.drop_vars(["target", "U", "simulated_J", "within", "U_within"])
    named = [
        parts.sel(experiment=name).drop_vars("experiment").assign_attrs(experiment=name) for name in names
    ]
    joined = validation.join(named, data)
    assert joined["experiment"].values.tolist() == names
    for name in ("target", "U", "simulated_J", "within"):
        np.testing.assert_array_equal(joined[name], predicted[name].sel(experiment=names), err_msg=name)


def test_a_quadratic_surface_is_found_and_its_limits_hold():
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 4)] * 2), axis=-1).reshape(-1, 2)

    def surface_of(designs):
        return np.stack([1 + designs[..., 0] * designs[..., 1], designs[..., 0] ** 2 - 2], axis=-1)

    at = np.array([0.3, 0.8])
    exact = surface.quadratic(grid, surface_of(grid), at)
    np.testing.assert_allclose(exact.value, surface_of(at))
    inside = []
    for _ in range(300):
        noisy = surface_of(grid) + 0.1 * rng.normal(size=(16, 2))
        found, new = surface.quadratic(grid, noisy, at), surface_of(at) + 0.1 * rng.normal(size=2)
        inside.append((found.low <= new) & (new <= found.high))
    assert np.mean(inside) == pytest.approx(0.9, abs=0.04)
    assert np.isnan(surface.quadratic(grid[:5], noisy[:5], at).low).all()
