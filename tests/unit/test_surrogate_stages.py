"""The stages `filter` and `train`, on curves of a known shape.

The curves are flat near the batch's fractions, with the counting noise of one run and a spike at the end.
"""

import json

import numpy as np
import pytest
import xarray as xr

from hopperopt import files
from hopperopt.outflow import GRID, objective, signed_root
from hopperopt.surrogate import prediction, split, targets, training

BATCH = np.array([8, 27, 64]) / 99
NOISE = np.array([0.0065, 0.0177, 0.0189])
FACTORS = {"theta_deg": [50, 60], "length_mm": [30, 50]}
FILTER = {
    "factors": FACTORS,
    "clip_sigma": 3.0,
    "split": "experiments",
    "validation_experiments": 4,
    "test_experiments": 4,
    "seed": 1,
}
TRAIN = {"hidden_nodes": [2, 4], "starts": 4, "selected_hidden_nodes": 4, "seed": 5}


def plan():
    """25 designs, every pair of levels once; (25, 2) in [-1, 1]."""
    return np.array([(i // 5, i % 5) for i in range(25)]) / 2 - 1


def noiseless(designs):
    """Mass fractions (experiments, 3, M) of the synthetic hopper."""
    a, b = designs[:, 0, None], designs[:, 1, None]
    spike = np.exp(-(1 - GRID) / 0.03)
    fine = BATCH[0] + 0.01 * a * np.sin(3 * GRID) + 0.08 * (1 + b) * spike
    intermediate = BATCH[1] + 0.02 * b * np.cos(3 * GRID) + 0.1 * a * spike
    return np.stack([fine, intermediate, 1 - fine - intermediate], axis=1)


def dataset(replicates=1, noise=1.0):
    rng = np.random.default_rng(0)
    curves = np.repeat(noiseless(plan())[:, None], replicates, axis=1)
    curves[:, :, 0] += noise * rng.normal(0, NOISE[0], curves[:, :, 0].shape)
    curves[:, :, 1] += noise * rng.normal(0, NOISE[1], curves[:, :, 1].shape)
    curves[:, :, 2] = 1 - curves[:, :, :2].sum(axis=2)
    levels = {name: np.mean(r) + plan()[:, k] * np.ptp(r) / 2 for k, (name, r) in enumerate(FACTORS.items())}
    return xr.Dataset(
        {
            "mass_fraction": (("experiment", "replicate", "size_class", "M"), curves),
            "counting_variance": (
                ("experiment", "replicate", "size_class", "M"),
                np.broadcast_to((noise * NOISE[:, None]) ** 2, curves.shape).copy(),
            ),
        },
        coords={
            "experiment": [f"exp_{n:02d}" for n in range(1, 26)],
            "replicate": np.arange(1, replicates + 1),
            "size_class": ["fine", "intermediate", "coarse"],
            "M": GRID,
            "target_fraction": ("size_class", BATCH),
            **{name: ("experiment", values, {"units": name[-2:]}) for name, values in levels.items()},
        },
    )


@pytest.fixture
def filtered(tmp_path):
    """Function that runs the stage `filter` on a dataset and returns its output."""

    def run(data, **params):
        files.write_netcdf(data, tmp_path / "dataset.nc")
        targets.filter_targets(FILTER | params, tmp_path / "dataset.nc", tmp_path / "training.nc")
        return files.read_netcdf(tmp_path / "training.nc")

    return run


@pytest.fixture
def trained(tmp_path, filtered):
    """Function that runs `filter` and `train`; returns the network's file and the table of errors."""

    def run(data, filter_params=None, **params):
        filtered(data, **(filter_params or {}))
        paths = [tmp_path / name for name in ("training.nc", "network.nc", "errors.csv")]
        training.train(TRAIN | params, *paths)
        return paths[1], files.read_table(paths[2]).set_index("hidden")

    return run


def used_as(result, use):
    return result.isel(experiment=result["split"].values == use)


def test_split_is_17_4_4_holds_the_extremes_and_follows_the_seed(filtered):
    results = [filtered(dataset(), seed=seed) for seed in (1, 1, 2)]
    for result in results:
        sizes = [used_as(result, use).sizes["experiment"] for use in ("training", "validation", "test")]
        assert sizes == [17, 4, 4]
        for name, (low, high) in FACTORS.items():
            assert {low, high} <= set(used_as(result, "training")[name].values)
    assert (results[0]["split"] == results[1]["split"]).all()
    assert (results[0]["split"] != results[2]["split"]).any()


def test_split_keeps_extremes_that_one_experiment_alone_holds():
    designs = np.random.default_rng(0).random((12, 4))
    extremes = {*designs.argmin(axis=0), *designs.argmax(axis=0)}
    for seed in range(20):
        labels = split.split_experiments(designs, 2, 1, seed)
        assert set(labels[list(extremes)]) == {"training"}
        assert ((labels == "validation").sum(), (labels == "test").sum()) == (2, 1)
    with pytest.raises(files.InputError, match="12 experiments are too few"):
        split.split_experiments(designs, 6, 6, 0)


def test_replicates_enter_as_their_mean(filtered):
    data = dataset(replicates=3)
    expected = data["mass_fraction"].mean("replicate").values[:, :2]
    np.testing.assert_allclose(filtered(data)["target"], expected, rtol=1e-14)
    data["mass_fraction"][4, 1] = np.nan
    expected = data["mass_fraction"][4, [0, 2]].mean("replicate").values[:2]
    np.testing.assert_allclose(filtered(data)["target"][4], expected, rtol=1e-14)


def test_experiment_without_a_complete_run_is_left_out(filtered):
    data = dataset()
    data["mass_fraction"][7] = np.nan
    result = filtered(data)
    assert "exp_08" not in result["experiment"].values
    assert (result.sizes["experiment"], result.attrs["left_out"]) == (24, "exp_08")
    assert not any(result[name].isnull().any() for name in ("target", "target_clipped", "J"))


@pytest.mark.parametrize("by", ["experiments", "points"])
def test_no_complete_run_at_all_is_refused_in_a_sentence(filtered, by):
    with pytest.raises(files.InputError, match="no experiment has a complete run"):
        filtered(dataset() * np.nan, split=by)


@pytest.mark.parametrize("by", ["experiments", "points"])
def test_too_few_experiments_left_are_refused(filtered, by):
    data = dataset()
    data["mass_fraction"][8:] = np.nan
    with pytest.raises(files.InputError, match="8 experiments are too few"):
        filtered(data, split=by)


def test_variance_of_a_mean_curve_is_its_runs_scatter_or_the_counting_variance_of_one(filtered):
    data = dataset(replicates=3)
    data["mass_fraction"][::2, 1:] = np.nan
    data["counting_variance"][::2, 1:] = np.nan
    result = filtered(data)
    assert result["runs"].values.tolist() == [1, 3] * 12 + [1]
    np.testing.assert_allclose(result["variance"][::2].mean(("experiment", "M")), NOISE[:2] ** 2)
    several = data["mass_fraction"][1::2].values[:, :, :2]
    np.testing.assert_allclose(result["variance"][1::2], several.var(axis=1, ddof=1) / 3)


def test_corrected_square_has_lost_the_noise_of_the_mean(filtered):
    """U scatters around J^2 of the curves without noise, whatever the number of runs."""
    data = dataset(replicates=3)
    data["mass_fraction"][::2, 1] = np.nan  # these have two runs left
    data["counting_variance"][::2, 1] = np.nan
    result = filtered(data)
    noiseless_square = objective(noiseless(plan())[:, :2], BATCH[:2]) ** 2
    bias = result["U"].values - noiseless_square
    for some in (bias[::2], bias[1::2]):
        standard_error = some.std(axis=0, ddof=1) / np.sqrt(len(some))
        assert (np.abs(some.mean(axis=0)) < 3 * standard_error).all()
        # Without the correction it would be off by the variance of the mean.
        assert (NOISE[:2] ** 2 / 3 > 2 * standard_error)[1]


def test_clip_moves_the_training_targets_to_three_sigma_and_nothing_else(filtered):
    result = filtered(dataset())
    held_out = result.isel(experiment=result["split"].values != "training")
    assert (held_out["target_clipped"] == held_out["target"]).all()
    inside = used_as(result, "training")
    for output in result["output"].values:
        target = inside["target"].sel(output=output).values
        reach = 3 * target.std(ddof=1)
        limits = target.mean() - reach, target.mean() + reach
        np.testing.assert_allclose(inside["target_clipped"].sel(output=output), np.clip(target, *limits))
        beyond = (target < limits[0]) | (target > limits[1])
        assert result["moved"].sel(output=output).values.tolist() == beyond.sum(axis=0).tolist()
    # It is the end's spike that is cut.
    assert result["moved"].sel(M=1.0).min() > 0
    assert result["moved"].sel(M=slice(0, 0.9)).sum() == 0


def test_limits_do_not_see_what_is_held_out(filtered):
    data = dataset()
    before = filtered(data)
    which = np.flatnonzero(before["split"].values != "training")
    data["mass_fraction"][which] += 0.5
    after = filtered(data)
    np.testing.assert_array_equal(before["clip_high"], after["clip_high"])


def test_objectives_with_and_without_the_clip(filtered):
    result = filtered(dataset())
    whole = objective(result["target"].values, BATCH[:2])
    np.testing.assert_allclose(result["J"], whole)
    assert (result["J_max"] > result["J_clipped_max"]).all()
    np.testing.assert_allclose(result["J_range"], whole.max(axis=0) - whole.min(axis=0))


def test_no_clip(filtered):
    result = filtered(dataset(), clip_sigma=None)
    assert (result["target_clipped"] == result["target"]).all()
    assert result["moved"].sum() == 0


def test_points_split_mixes_the_experiments(filtered):
    result = filtered(dataset(), split="points")
    assert result["split"].dims == ("experiment", "M")
    assert result.attrs["split_by"] == "points"
    counts = [int((result["split"] == use).sum()) for use in ("training", "validation", "test")]
    assert counts == [17 * 21, 4 * 21, 4 * 21]
    assert ((result["split"] == "test").any("M")).sum() > 20


def test_network_file_gives_back_the_predictor_and_its_origin(trained):
    path, errors = trained(dataset())
    predictor, stored = prediction.load(path), files.read_netcdf(path)
    assert predictor.factors == tuple(FACTORS)
    assert stored["hidden_weights"].sizes == {"member": 1, "hidden": 4, "input": 3}
    assert stored.attrs["start"] == errors.loc[4, "start"]
    assert (stored.attrs["seed"], stored.attrs["split_by"]) == (5, "experiments")
    assert "numpy" in json.loads(stored.attrs["versions"])
    for name in ("clip_low", "clip_high", "split"):
        assert name in stored

    design = {"length_mm": 40.0, "theta_deg": 52.5}
    row = predictor.array(design)
    assert row.tolist() == [[52.5, 40.0]]
    curve = predictor.curves(row)
    assert curve.shape == (1, 2, 21)
    np.testing.assert_allclose(predictor.objectives(row), objective(curve, BATCH[:2]))
    with pytest.raises(files.InputError, match="theta_deg, length_mm"):
        predictor.array({"theta_deg": 55.0})


@pytest.mark.parametrize(("by", "judging"), [("experiments", 4), ("points", 25)])
def test_uncertainty_of_the_objectives_is_that_of_the_experiments_that_stop_the_training(
    trained, tmp_path, by, judging
):
    path, _ = trained(dataset(replicates=2), {"split": by})
    predictor, data = prediction.load(path), files.read_netcdf(tmp_path / "training.nc")
    if by == "experiments":
        data = used_as(data, "validation")
    assert data.sizes["experiment"] == judging
    for k, output in enumerate(("fine", "intermediate")):
        errors = [
            predictor.objectives(np.array([[one["theta_deg"], one["length_mm"]]]))[0, k]
            - signed_root(one["U"].sel(output=output).item())
            for one in (data.isel(experiment=n) for n in range(judging))
        ]
        assert predictor.objective_error[k] == pytest.approx(np.sqrt(np.mean(np.square(errors))))


def test_errors_are_those_of_the_stored_network_against_unclipped_targets(trained, tmp_path):
    path, errors = trained(dataset())
    data = files.read_netcdf(tmp_path / "training.nc")
    predictor = prediction.load(path)
    designs = np.column_stack([data[name] for name in FACTORS])
    squares = (predictor.curves(designs) - data["target"].values) ** 2
    for use in ("training", "validation", "test"):
        rmse = np.sqrt(squares[data["split"].values == use].mean(axis=(0, 2)))
        reported = errors.loc[4, [f"{use}_rmse_fine", f"{use}_rmse_intermediate"]].astype(float)
        np.testing.assert_allclose(reported, rmse, rtol=1e-8)
    assert errors["selected"].tolist() == [False, True]


def test_network_finds_the_curves_behind_the_noise(trained):
    path, errors = trained(
        dataset(noise=0.3), {"clip_sigma": None}, hidden_nodes=[6], selected_hidden_nodes=6
    )
    designs = np.array([[53.0, 42.0], [57.0, 33.0]])
    truth = noiseless((designs - [55, 40]) / [5, 10])[:, :2]
    assert np.sqrt(np.mean((prediction.load(path).curves(designs) - truth) ** 2)) < 0.006
    assert errors["test_rmse_fine"].iloc[0] < 0.01


def test_same_seed_same_files_and_another_seed_others(trained):
    networks = [files.read_netcdf(trained(dataset(), seed=seed)[0]) for seed in (5, 5, 6)]
    assert networks[0].identical(networks[1])
    assert not networks[0].equals(networks[2])


def test_test_experiments_choose_nothing(trained):
    """Whatever the test experiments hold, the same networks come out; with `auto` too."""
    data = dataset()
    first, errors = trained(data, selected_hidden_nodes="auto")
    first = files.read_netcdf(first)
    data["mass_fraction"][np.flatnonzero(first["split"].values == "test"), :, :2] += 0.3
    second, other = trained(data, selected_hidden_nodes="auto")
    np.testing.assert_array_equal(first["hidden_weights"], files.read_netcdf(second)["hidden_weights"])
    test = [column for column in errors if column.startswith("test")]
    assert errors.drop(columns=test).equals(other.drop(columns=test))
    assert (other[test] > 0.2).all(axis=None)


def test_auto_takes_the_size_that_cross_validates_best(trained):
    path, errors = trained(dataset(noise=0.2), {"clip_sigma": None}, selected_hidden_nodes="auto")
    scores = errors[["cross_validation_rmse_fine", "cross_validation_rmse_intermediate"]]
    assert scores.notna().all(axis=None)
    # Two nodes cannot hold a spike and two trends; the larger network wins in both outputs.
    assert (scores.loc[4] < scores.loc[2]).all()
    assert errors["selected"].tolist() == [False, True]
    assert files.read_netcdf(path).sizes["hidden"] == 4


@pytest.mark.parametrize("by", ["experiments", "points"])
def test_cross_validation_judges_whole_groups_once_and_never_trains_on_them(trained, monkeypatch, by):
    seen = []

    class Spy(training.NetworkRegressor):
        def fit(self, X, y, validation=None, groups=None):
            seen.append([{tuple(row) for row in rows} for rows in (X, validation[0])])
            return super().fit(X, y, validation)

        def predict(self, X):
            seen[-1].append({tuple(row) for row in X})
            return super().predict(X)

    monkeypatch.setattr(training, "NetworkRegressor", Spy)
    trained(dataset(), {"split": by}, hidden_nodes=[2], starts=1, selected_hidden_nodes="auto")
    folds = seen[:5]
    judged = [row for fold in folds for row in fold[2]]
    assert len(judged) == len(set(judged)) == 21 * 21
    for fold in folds:
        designs = [{row[:-1] for row in part} if by == "experiments" else part for part in fold[:3]]
        assert not designs[0] & designs[1]
        assert not designs[2] & (designs[0] | designs[1])


def test_selected_size_must_have_been_trained(trained):
    with pytest.raises(files.InputError, match="selected_hidden_nodes: 7 is not allowed"):
        trained(dataset(), selected_hidden_nodes=7)
