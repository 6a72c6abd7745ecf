"""Gaussian processes and ensembles on curves of a known shape, with noise of a known size."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from hopperopt import files
from hopperopt.outflow import GRID, objective
from hopperopt.surrogate import ensemble, gaussian, prediction, process

NETWORKS = {"hidden_nodes": 3, "starts": 3, "seed": 1}


def predictor(synthetic, model):
    return prediction.Predictor(tuple(synthetic.factors), GRID, synthetic.batch, model)


@pytest.mark.parametrize("runs", [1, 3])
def test_intervals_of_the_processes_cover_nine_of_ten(synthetic, runs):
    """Mean curves of fresh runs, and the curves without noise; six plans, thirty new designs each."""
    seen, true = [], []
    rng = np.random.default_rng(runs)
    for seed in range(6):
        model = gaussian.fit(synthetic.training(runs, seed=seed))
        designs = synthetic.anywhere(30, rng)
        truth, variance = synthetic.curves(designs), synthetic.noise[:, None] ** 2 / runs
        fresh = truth + np.sqrt(variance) * rng.normal(size=truth.shape)
        mean, error = model.moments(designs, GRID)
        true.append(np.abs(truth - mean) < 1.645 * np.sqrt(error))
        seen.append(np.abs(fresh - mean) < 1.645 * np.sqrt(error + variance))
    assert np.mean(seen) == pytest.approx(0.9, abs=0.03)
    assert np.mean(true) == pytest.approx(0.92, abs=0.04)


def test_the_processes_find_the_curves_behind_the_noise(synthetic):
    data, designs = synthetic.training(3), synthetic.anywhere(50, np.random.default_rng(0))
    truth, model = synthetic.curves(designs), predictor(synthetic, gaussian.fit(data))
    error = np.sqrt(np.mean((model.curves(designs) - truth) ** 2, axis=(0, 2)))
    assert (error < synthetic.noise / np.sqrt(3)).all()
    J = objective(truth, synthetic.batch)
    assert (np.sqrt(np.mean((model.objectives(designs) - J) ** 2, axis=0)) < 0.6 * J.std(axis=0)).all()


def test_some_of_many_experiments_find_the_hyperparameters_and_all_predict(synthetic, monkeypatch):
    data, designs = synthetic.training(3), synthetic.anywhere(50, np.random.default_rng(0))
    whole = gaussian.fit(data)
    monkeypatch.setattr(process, "SEARCHED", 13)
    part = gaussian.fit(data)
    assert len(part.designs) == 25 and not np.array_equal(part.lengths, whole.lengths)
    difference = part.moments(designs, GRID)[0] - whole.moments(designs, GRID)[0]
    assert (np.sqrt(np.mean(difference**2, axis=(0, 2))) < synthetic.noise / np.sqrt(3)).all()


def test_of_many_experiments_some_are_inducing_ones(synthetic, monkeypatch):
    """Curves, draws and what is learnt from a design that is believed are those of the exact processes."""
    data, designs = synthetic.training(3), synthetic.anywhere(20, np.random.default_rng(0))
    new = designs[:1]
    found = []
    for exact in (25, 20):
        monkeypatch.setattr(process, "EXACT", exact)
        model = gaussian.fit(data)
        assert {type(one).__name__ for one in model._processes} == (
            {"GaussianProcessRegressor"} if exact == 25 else {"Inducing"}
        )
        drawn = model.draws(designs, GRID, 400, np.random.default_rng(1))
        found.append((*model.moments(designs, GRID), drawn.mean(axis=0), drawn.var(axis=0)))
        before, after = model.moments(new, GRID)[1], model.believing(new[0], 10).moments(new, GRID)[1]
        found[-1] += (after / before,)
    exact, inducing = found
    error = synthetic.noise[:, None] / np.sqrt(3)
    for ours, theirs in zip(inducing[:4:2], exact[:4:2], strict=True):
        assert (np.abs(ours - theirs) < 0.3 * error).all()
    for ours, theirs in zip(inducing[1::2], exact[1::2], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0.25)
    np.testing.assert_allclose(inducing[4], exact[4], atol=0.1)


def test_inducing_inputs_know_the_latest_design(monkeypatch):
    """A batch of infill believes each design before it looks for the next one."""
    rng = np.random.default_rng(5)
    inputs, values = np.vstack([rng.uniform(-1, 1, (399, 4)), np.zeros(4)]), rng.normal(size=400)
    monkeypatch.setattr(process, "EXACT", 100)
    kernel, noise = ConstantKernel(1000.0) * Matern(np.full(4, 2.0), nu=2.5), np.append(np.ones(399), 0.01)
    _, deviation = process.conditioned(kernel, inputs, values, noise).predict(inputs[-1:], return_std=True)
    assert deviation == pytest.approx(0.1, rel=0.05)


def test_inducing_inputs_are_the_latest_and_those_far_apart():
    points = np.array([[0.0], [1.0], [9.0], [10.0], [4.0], [10.0], [8.0]])
    assert process.far_apart(points, 4, [5, 3, 6]).tolist() == [5, 6, 0, 4]
    assert sorted(process.far_apart(points, 10, []).tolist()) == [0, 1, 2, 3, 4, 6]


def test_the_processes_are_conditioned_once(synthetic, monkeypatch):
    """It takes the cube of the number of experiments, and a search predicts a hundred times."""
    model, fitted = gaussian.fit(synthetic.training(3)), []
    fit = GaussianProcessRegressor.fit
    monkeypatch.setattr(
        GaussianProcessRegressor, "fit", lambda self, *data: fitted.append(self) or fit(self, *data)
    )
    for _ in range(3):
        model.moments(synthetic.designs, GRID)
    model.draws(synthetic.designs, GRID, 2, np.random.default_rng(0))
    assert len(fitted) == len(model.components)


def test_many_values_condition_a_process_by_inducing_inputs(monkeypatch):
    """Held against the process that all values condition, and one that a part of them does."""
    rng = np.random.default_rng(3)
    inputs, elsewhere = rng.uniform(-1, 1, (600, 3)), rng.uniform(-1, 1, (200, 3))
    kernel = ConstantKernel(30.0) * Matern([1.0, 2.0, 40.0], nu=2.5)
    truth = rng.multivariate_normal(np.zeros(600), kernel(inputs), method="eigh")
    noise = 1 / rng.integers(1, 6, 600)
    values = truth + np.sqrt(noise) * rng.normal(size=600)
    exact = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None).fit(inputs, values)
    mean, deviation = exact.predict(elsewhere, return_std=True)

    def compared(model):
        found, spread = model.predict(elsewhere, return_std=True)
        return np.sqrt(np.mean(((found - mean) / deviation) ** 2)), np.abs(spread / deviation - 1).max()

    monkeypatch.setattr(process, "EXACT", 150)
    many = process.conditioned(kernel, inputs, values, noise)
    missed, wrong = compared(many)
    assert missed < 0.1 and wrong < 0.1
    part = slice(150)
    assert compared(process.conditioned(kernel, inputs[part], values[part], noise[part]))[0] > 5 * missed
    covariance = exact.predict(elsewhere, return_cov=True)[1]
    np.testing.assert_allclose(
        many.predict(elsewhere, return_cov=True)[1], covariance, atol=0.1 * deviation.max() ** 2
    )
    np.testing.assert_array_equal(many.predict(elsewhere), many.predict(elsewhere, return_std=True)[0])
    # With all of them as inducing inputs it is the exact one; inputs that are there twice do no harm.
    monkeypatch.setattr(process, "EXACT", 700)
    missed, wrong = compared(process.Inducing(kernel, inputs, values, noise))
    assert missed < 1e-4 and wrong < 1e-4
    twice = process.Inducing(kernel, *(np.repeat(part, 2, axis=0) for part in (inputs, values, 2 * noise)))
    assert len(twice.inputs) == 600 and compared(twice)[0] < 1e-4


def test_without_an_effect_the_processes_predict_one_curve(synthetic):
    designs, bias = synthetic.anywhere(50, np.random.default_rng(0)), []
    J = objective(synthetic.curves(synthetic.designs).mean(axis=0), synthetic.batch)
    for seed in range(6):
        model = predictor(synthetic, gaussian.fit(synthetic.training(3, seed, effect=0)))
        spread = model.curves(designs).std(axis=0).mean(axis=-1)
        assert (spread < 0.25 * synthetic.noise / np.sqrt(3)).all()
        bias.append((model.objectives(designs) ** 2).mean(axis=0) - J**2)
    # Nor does noise add to J: less than a tenth of what it adds to that of one design's mean curve.
    assert (np.abs(np.mean(bias, axis=0)) < 0.1 * synthetic.noise**2 / 3).all()


def fitted(synthetic):
    data = synthetic.training(3)
    return {
        "gaussian": gaussian.fit(data),
        "ensemble": ensemble.fit(data, clip_sigma=np.inf, **NETWORKS),
    }


def test_draws_have_the_moments_and_are_joint_over_the_designs(synthetic):
    designs = synthetic.anywhere(3, np.random.default_rng(0))
    designs = np.vstack([designs, designs[0] + 1e-6])
    for model in fitted(synthetic).values():
        draws = model.draws(designs, GRID, 8000, np.random.default_rng(1))
        mean, variance = model.moments(designs, GRID)
        np.testing.assert_allclose(draws.mean(axis=0), mean, atol=5 * np.sqrt(variance.max() / 8000))
        np.testing.assert_allclose(draws.var(axis=0), variance, rtol=0.1, atol=1e-9)
        J = objective(draws, synthetic.batch)
        squares = np.sqrt(np.mean(J**2, axis=0))
        np.testing.assert_allclose(predictor(synthetic, model).objectives(designs), squares, rtol=0.02)
        twin, other = (np.var(J[:, 0] - J[:, k], axis=0) for k in (3, 1))
        assert (twin < 0.5 * other).all()


def test_a_file_gives_back_the_surrogate(synthetic, tmp_path):
    designs = synthetic.anywhere(4, np.random.default_rng(0))
    for name, model in fitted(synthetic).items():
        one = predictor(synthetic, model)._replace(objective_error=np.array([0.001, 0.002]))
        prediction.save(tmp_path / f"{name}.nc", one, {}, {"title": name})
        read = prediction.load(tmp_path / f"{name}.nc")
        assert read.factors == one.factors and read.objective_error.tolist() == [0.001, 0.002]
        for draws in (2, 3):
            first, second = (each.draws(designs, draws, np.random.default_rng(draws)) for each in (one, read))
            np.testing.assert_array_equal(first, second)
        np.testing.assert_array_equal(read.objectives(designs), one.objectives(designs))
        assert files.read_netcdf(tmp_path / f"{name}.nc").attrs["title"] == name


def test_each_fold_stops_one_member_and_trains_the_others(synthetic, monkeypatch):
    seen = []

    class Spy(ensemble.NetworkRegressor):
        def fit(self, X, y, validation=None, groups=None):
            seen.append([{tuple(row[:-1]) for row in rows} for rows in (X, validation[0])])
            return super().fit(X, y, validation)

    monkeypatch.setattr(ensemble, "NetworkRegressor", Spy)
    model = ensemble.fit(synthetic.training(1), clip_sigma=np.inf, **NETWORKS)
    assert len(model.members) == len(seen) == 5
    for training, stopping in seen:
        assert not training & stopping and len(training) + len(stopping) == 25
    assert set.union(*(stopping for _, stopping in seen)) == {tuple(row) for row in synthetic.designs}


def test_members_see_clipped_targets_and_stop_on_simulated_ones(synthetic):
    """The spike at the end is cut off by a clip, and stands in the curves without one."""
    data = synthetic.training(3)
    whole, clipped = (
        ensemble.fit(data, clip_sigma=sigma, **NETWORKS | {"hidden_nodes": 5})
        .moments(synthetic.designs, GRID)[0][:, 0, -1]
        .max()
        for sigma in (np.inf, 1.5)
    )
    assert clipped < 0.8 * whole
