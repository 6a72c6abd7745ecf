"""Networks and their Levenberg-Marquardt training, against slow and independent ways to the same numbers."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime, least_squares
from threadpoolctl import threadpool_limits

from hopperopt.surrogate import levenberg_marquardt, network

INPUTS, OUTPUTS = 2, 2


def seeds(count, entropy=0):
    return [np.random.SeedSequence(entropy, spawn_key=(start,)) for start in range(count)]


def sample(rows, seed):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (rows, INPUTS))
    y = np.column_stack([np.sin(2 * x[:, 0]) + x[:, 1] ** 2, x[:, 0] * x[:, 1]])
    return levenberg_marquardt.Sample(network.columns(x), (y + rng.normal(0, 0.1, y.shape)).T.copy())


def residuals(vector, hidden_nodes, data):
    weights = network.unflatten(vector[None], hidden_nodes, INPUTS, OUTPUTS)
    return (network.forward(weights, data.inputs)[1][0] - data.targets).ravel()


def test_forward_is_the_papers_network():
    weights = network.initial_weights(3, INPUTS, OUTPUTS, seeds(2))
    x = np.array([0.3, -0.8])
    _, outputs = network.forward(weights, network.columns(x[None]))
    for which in range(2):
        hidden, output = weights.hidden[which], weights.output[which]
        activation = [1 / (1 + np.exp(-(node[:2] @ x + node[2]))) for node in hidden]
        expected = [node[:3] @ activation + node[3] for node in output]
        np.testing.assert_allclose(outputs[which, :, 0], expected, rtol=1e-13)


def test_forward_saturates_without_overflow():
    weights = network.Weights(np.full((1, 1, 2), 1e4), np.array([[[1.0, 0.0]]]))
    with np.errstate(all="raise"):
        _, outputs = network.forward(weights, network.columns(np.array([[-2.0], [2.0]])))
    assert outputs[0, 0].tolist() == [0.0, 1.0]


def test_normal_equations_are_those_of_the_finite_differences():
    data = sample(40, seed=1)
    weights = network.initial_weights(3, INPUTS, OUTPUTS, seeds(2))
    activations, outputs = network.forward(weights, data.inputs)
    matrix, gradient = network.normal_equations(weights, data.inputs, activations, outputs - data.targets)
    for which, vector in enumerate(network.flatten(weights)):
        jacobian = approx_fprime(vector, residuals, 1e-7, 3, data)
        np.testing.assert_allclose(matrix[which], jacobian.T @ jacobian, atol=1e-5)
        np.testing.assert_allclose(gradient[which], jacobian.T @ residuals(vector, 3, data), atol=1e-5)


def test_first_epoch_is_the_damped_step_with_mu_over_the_number_of_residuals():
    data = sample(40, seed=1)
    start = network.initial_weights(3, INPUTS, OUTPUTS, seeds(1))
    vector = network.flatten(start)[0]
    jacobian = approx_fprime(vector, residuals, 1e-7, 3, data)
    count = data.targets.size
    damped = jacobian.T @ jacobian / count + 1e-3 * np.eye(vector.size)
    expected = vector - np.linalg.solve(damped, jacobian.T @ residuals(vector, 3, data) / count)
    fitted = levenberg_marquardt.fit(start, data, max_epochs=1)
    assert fitted.training_error[0] < np.mean(residuals(vector, 3, data) ** 2)
    np.testing.assert_allclose(network.flatten(fitted.weights)[0], expected, atol=1e-4)


def test_scipy_finds_no_better_minimum_from_the_same_starts():
    data = sample(60, seed=3)
    start = network.initial_weights(3, INPUTS, OUTPUTS, seeds(10))
    fitted = levenberg_marquardt.fit(start, data)
    oracle = [
        2 * least_squares(residuals, vector, args=(3, data), xtol=1e-10, ftol=1e-10).cost / data.targets.size
        for vector in network.flatten(start)
    ]
    # Two good methods may still end in different valleys from a start or two.
    better = fitted.training_error > 1.001 * np.array(oracle)
    assert better.sum() <= 2
    assert fitted.training_error.min() <= 1.0001 * min(oracle)


def test_networks_do_not_depend_on_their_batch(monkeypatch):
    training, validation = sample(60, seed=3), sample(30, seed=4)
    start = network.initial_weights(5, INPUTS, OUTPUTS, seeds(12))
    together = levenberg_marquardt.fit(start, training, validation)
    monkeypatch.setattr(levenberg_marquardt, "BATCH_ROWS", 1)
    alone = levenberg_marquardt.fit(start, training, validation)
    for ours, theirs in zip(network.flatten(together.weights), network.flatten(alone.weights), strict=True):
        assert ours.tobytes() == theirs.tobytes()
    np.testing.assert_array_equal(together.epochs, alone.epochs)
    np.testing.assert_array_equal(together.validation_error, alone.validation_error)


def test_data_in_parts_train_the_same_networks(monkeypatch):
    """Sums of many rows are those of their parts; the last bits of a sum are not the same."""
    training, validation = sample(60, seed=3), sample(30, seed=4)
    start = network.initial_weights(4, INPUTS, OUTPUTS, seeds(6))
    whole = levenberg_marquardt.fit(start, training, validation, max_epochs=20)
    monkeypatch.setattr(levenberg_marquardt, "PART_ROWS", 25)
    parts = levenberg_marquardt.fit(start, training, validation, max_epochs=20)
    np.testing.assert_array_equal(parts.epochs, whole.epochs)
    np.testing.assert_allclose(parts.training_error, whole.training_error, rtol=1e-6)
    np.testing.assert_allclose(parts.validation_error, whole.validation_error, rtol=1e-6)


def test_cores_change_no_bit_of_many_predictions():
    """BLAS shares a product among the cores where it is large enough, and ends it differently."""
    weights = network.initial_weights(7, INPUTS, OUTPUTS, seeds(1))
    same = network.Scaling(np.zeros(INPUTS), np.ones(INPUTS))
    trained = network.Network(weights.hidden[0], weights.output[0], same, same)
    inputs = np.random.default_rng(1).uniform(-1, 1, (network.CHUNK, INPUTS))
    predictions = []
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            predictions.append(trained.predict(inputs).tobytes())
    assert predictions[0] == predictions[1]


def test_training_stops_six_epochs_after_the_best_validation_epoch():
    training, validation = sample(30, seed=3), sample(30, seed=4)
    start = network.initial_weights(8, INPUTS, OUTPUTS, seeds(6))
    fitted = levenberg_marquardt.fit(start, training, validation)
    assert (fitted.epochs < 100).all(), "this small sample must be overfitted for the test to mean anything"
    for which, epochs in enumerate(fitted.epochs):
        one = network.Weights(*(layer[[which]] for layer in start))
        best = levenberg_marquardt.fit(one, training, validation, max_epochs=epochs - 6)
        assert network.flatten(best.weights)[0].tobytes() == network.flatten(fitted.weights)[which].tobytes()
        if epochs > 6:
            before = levenberg_marquardt.fit(one, training, validation, max_epochs=epochs - 7)
            assert before.validation_error[0] > fitted.validation_error[which]


def test_reported_errors_are_those_of_the_kept_weights():
    training, validation = sample(30, seed=3), sample(30, seed=4)
    fitted = levenberg_marquardt.fit(network.initial_weights(8, 2, 2, seeds(3)), training, validation)
    for which, vector in enumerate(network.flatten(fitted.weights)):
        for reported, data in (
            (fitted.training_error, training),
            (fitted.validation_error, validation),
        ):
            assert reported[which] == pytest.approx(np.mean(residuals(vector, 8, data) ** 2), rel=1e-12)


def test_a_dead_node_does_not_stop_the_training():
    """Two equal nodes, and one whose output weight and slope vanish, make J'J singular."""
    data = sample(30, seed=3)
    start = network.initial_weights(4, INPUTS, OUTPUTS, seeds(1))
    start.hidden[0, 1] = start.hidden[0, 0]
    start.output[0, :, 1] = start.output[0, :, 0]
    start.hidden[0, 2] = [0, 0, 1e3]
    start.output[0, :, 2] = 0
    before = np.mean(residuals(network.flatten(start)[0], 4, data) ** 2)
    fitted = levenberg_marquardt.fit(start, data)
    assert np.isfinite(network.flatten(fitted.weights)).all()
    assert fitted.training_error[0] < 0.5 * before


def test_a_step_that_cannot_be_solved_for_is_none():
    matrices, gradients = np.stack([np.eye(2), -np.eye(2)]), np.array([[3.0, 4.0], [3.0, 4.0]])
    steps = levenberg_marquardt._damped_solution(matrices, np.array([1.0, 0.5]), gradients)
    np.testing.assert_allclose(steps, [[1.5, 2], [0, 0]])


def test_scalings_keep_constant_columns():
    values = np.column_stack([np.linspace(3, 5, 9), np.full(9, 7.0)])
    for make in (network.range_scaling, network.standard_scaling):
        scaling = make(values)
        assert (scaling.normalise(values)[:, 1] == 0).all()
        np.testing.assert_allclose(scaling.restore(scaling.normalise(values)), values, rtol=1e-14)
    ends = network.range_scaling(values).normalise(values)[[0, -1], 0]
    np.testing.assert_allclose(ends, [-1, 1])
