"""Levenberg-Marquardt training of many networks at once: the rule of MATLAB's trainlm, early stopping."""

from typing import NamedTuple

import numpy as np

from hopperopt.surrogate.network import Weights, flatten, forward, normal_equations, one_thread, unflatten

MU_START, MU_GROWTH, MU_DECAY, MU_MAX, MU_MIN = 1e-3, 10.0, 0.1, 1e10, 1e-20
VALIDATION_FAILURES = 6
MIN_GRADIENT = 1e-7
MAX_EPOCHS = 1000
BATCH_ROWS = 20_000  # rows of data of all networks that are trained together, to bound the memory


class Fit(NamedTuple):
    """Outcome of n trainings."""

    weights: Weights  # of the best epoch
    epochs: np.ndarray  # (n,) steps taken
    training_error: np.ndarray  # (n,) mean squared residual over rows and outputs at the best epoch
    validation_error: np.ndarray  # (n,) the same over the validation rows


class Sample(NamedTuple):
    """Normalised data: inputs (inputs + 1, rows) from `network.columns`, targets (outputs, rows)."""

    inputs: np.ndarray
    targets: np.ndarray


@one_thread
def fit(
    start: Weights, training: Sample, validation: Sample | None = None, max_epochs: int = MAX_EPOCHS
) -> Fit:
    """Train every network of `start` on the same data.

    The step solves (J'J / r + mu 1) step = J'e / r with r residuals e; mu falls tenfold after a step that
    lowers the mean squared residual, and grows tenfold, the step being taken back, after any other. A network
    is finished after 6 epochs (accepted steps) in a row without a new lowest validation error, when mu
    exceeds 1e10, when the gradient falls below 1e-7, or after `max_epochs`. It keeps the weights of its best
    validation epoch, the start included. Without validation data the training error takes its place, so that
    it is trained to its end.

    start: Weights of n networks; training, validation: Sample. Returns Fit; every network's result depends on
    its own start alone, to the bit.
    """
    batch = max(1, BATCH_ROWS // training.targets.shape[1])
    parts = [
        _fit_batch(
            Weights(*(layer[first : first + batch] for layer in start)), training, validation, max_epochs
        )
        for first in range(0, len(start.hidden), batch)
    ]
    weights = Weights(
        *(np.concatenate(layers) for layers in zip(*(part.weights for part in parts), strict=True))
    )
    return Fit(weights, *(np.concatenate([part[item] for part in parts]) for item in (1, 2, 3)))


class _State(NamedTuple):
    """Networks still in training, the first axis the networks; names as in `_fit_batch`."""

    index: np.ndarray  # type: ignore[assignment]  # a tuple has a method of that name
    vector: np.ndarray
    error: np.ndarray
    matrix: np.ndarray
    gradient: np.ndarray
    mu: np.ndarray
    failures: np.ndarray


def _fit_batch(start, training, validation, max_epochs):
    """`fit` for networks that are stepped together; those that have finished leave the batch."""
    count, hidden_nodes, width = start.hidden.shape
    shape = hidden_nodes, width - 1, start.output.shape[1]
    activations, residuals = _evaluate(start, training)
    error = _mean_square(residuals)
    matrix, gradient = _linearise(start, training, activations, residuals)
    best = Fit(flatten(start), np.zeros(count, dtype=int), error.copy(), _monitor(start, error, validation))
    state = _State(
        np.arange(count),
        flatten(start),
        error,
        matrix,
        gradient,
        np.full(count, MU_START),
        np.zeros(count, dtype=int),
    )
    while True:
        stationary = 2 * np.linalg.norm(state.gradient, axis=1) < MIN_GRADIENT
        going = (
            (state.failures < VALIDATION_FAILURES)
            & (state.mu <= MU_MAX)
            & (best.epochs[state.index] < max_epochs)
            & ~stationary
        )
        if not going.any():
            return best._replace(weights=unflatten(best.weights, *shape))
        if not going.all():
            state = _State(*(item[going] for item in state))
        _step(state, best, shape, training, validation)


def _step(state, best, shape, training, validation):
    """Try one step of every network in `state`; changes `state` and `best` in place."""
    trial = state.vector - _damped_solution(state.matrix, state.mu, state.gradient)
    trial_weights = unflatten(trial, *shape)
    activations, residuals = _evaluate(trial_weights, training)
    error = _mean_square(residuals)
    lower = error < state.error
    state.mu[:] = np.where(lower, np.maximum(state.mu * MU_DECAY, MU_MIN), state.mu * MU_GROWTH)
    if not lower.any():
        return
    accepted = Weights(*(layer[lower] for layer in trial_weights))
    state.vector[lower] = trial[lower]
    state.error[lower] = error[lower]
    state.matrix[lower], state.gradient[lower] = _linearise(
        accepted, training, activations[lower], residuals[lower]
    )

    index = state.index[lower]
    best.epochs[index] += 1
    monitored = _monitor(accepted, state.error[lower], validation)
    progress = monitored < best.validation_error[index]
    state.failures[lower] = np.where(progress, 0, state.failures[lower] + 1)
    index = index[progress]
    best.weights[index] = trial[lower][progress]
    best.training_error[index] = state.error[lower][progress]
    best.validation_error[index] = monitored[progress]


def _evaluate(weights, sample):
    """Activations and residuals of n networks."""
    activations, outputs = forward(weights, sample.inputs)
    return activations, outputs - sample.targets


def _mean_square(residuals):
    """Mean squared residual (n,) of n networks."""
    return np.mean((residuals**2).reshape(len(residuals), -1), axis=1)


def _monitor(weights, training_error, validation):
    """Error that decides on stopping: on the validation data where there are any, else the training error."""
    return training_error.copy() if validation is None else _mean_square(_evaluate(weights, validation)[1])


def _linearise(weights, training, activations, residuals):
    """J'J and J'e over the number of residuals, of n networks."""
    matrix, gradient = normal_equations(weights, training.inputs, activations, residuals)
    return matrix / training.targets.size, gradient / training.targets.size


def _damped_solution(matrix, mu, gradient):
    """Solve (matrix + mu 1) x = gradient of every network; 0 where singular: no progress, mu grows."""
    damped = matrix + mu[:, None, None] * np.eye(matrix.shape[1])
    try:
        return np.linalg.solve(damped, gradient[..., None])[..., 0]
    except np.linalg.LinAlgError:
        solution = np.zeros_like(gradient)
        for network in range(len(matrix)):
            try:
                solution[network] = np.linalg.solve(damped[network], gradient[network])
            except np.linalg.LinAlgError:
                continue
        return solution
