"""Levenberg-Marquardt training of many networks at once: the rule of MATLAB's trainlm, early stopping."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from hopperopt.surrogate.network import Weights, flatten, forward, normal_equations, one_thread, unflatten

MU_START, MU_GROWTH, MU_DECAY, MU_MAX, MU_MIN = 1e-3, 10.0, 0.1, 1e10, 1e-20
VALIDATION_FAILURES = 6
MIN_GRADIENT = 1e-7
MAX_EPOCHS = 1000
BATCH_ROWS = 20_000  # rows of data of all networks that are trained together, to bound the memory
PART_ROWS = 4_000  # rows of data that are worked on at a time, so that they stay in the cache


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
    training_parts, validation_parts = _parts(training), validation and _parts(validation)
    fits = [
        _fit_batch(
            Weights(*(layer[first : first + batch] for layer in start)),
            training_parts,
            validation_parts,
            max_epochs,
        )
        for first in range(0, len(start.hidden), batch)
    ]
    weights = Weights(
        *(np.concatenate(layers) for layers in zip(*(one.weights for one in fits), strict=True))
    )
    return Fit(weights, *(np.concatenate([one[item] for one in fits]) for item in (1, 2, 3)))


def _parts(sample):
    """A sample in parts of a few thousand rows."""
    return [
        Sample(*(np.ascontiguousarray(of_all[:, first : first + PART_ROWS]) for of_all in sample))
        for first in range(0, sample.targets.shape[1], PART_ROWS)
    ]


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
    """`fit` for networks that are stepped together; those that have finished leave the batch.

    training, validation: samples in parts.
    """
    count, hidden_nodes, width = start.hidden.shape
    shape = hidden_nodes, width - 1, start.output.shape[1]
    evaluated = _evaluate(start, training)
    error = _mean_square(evaluated)
    matrix, gradient = _linearise(start, training, evaluated)
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
    evaluated = _evaluate(trial_weights, training)
    error = _mean_square(evaluated)
    lower = error < state.error
    state.mu[:] = np.where(lower, np.maximum(state.mu * MU_DECAY, MU_MIN), state.mu * MU_GROWTH)
    if not lower.any():
        return
    accepted = Weights(*(layer[lower] for layer in trial_weights))
    state.vector[lower] = trial[lower]
    state.error[lower] = error[lower]
    evaluated = [(activations[lower], residuals[lower]) for activations, residuals in evaluated]
    state.matrix[lower], state.gradient[lower] = _linearise(accepted, training, evaluated)

    index = state.index[lower]
    best.epochs[index] += 1
    monitored = _monitor(accepted, state.error[lower], validation)
    progress = monitored < best.validation_error[index]
    state.failures[lower] = np.where(progress, 0, state.failures[lower] + 1)
    index = index[progress]
    best.weights[index] = trial[lower][progress]
    best.training_error[index] = state.error[lower][progress]
    best.validation_error[index] = monitored[progress]


def _evaluate(weights, parts):
    """Activations (n, hidden + 1, rows) and residuals (n, outputs, rows) of n networks for each part."""
    evaluated = []
    for part in parts:
        activations, outputs = forward(weights, part.inputs)
        evaluated.append((activations, outputs - part.targets))
    return evaluated


def _mean_square(evaluated):
    """Mean squared residual (n,) of n networks, from what `_evaluate` returns."""
    squares = [(residuals**2).reshape(len(residuals), -1) for _, residuals in evaluated]
    return sum(part.sum(axis=1) for part in squares) / sum(part.shape[1] for part in squares)


def _monitor(weights, training_error, validation):
    """Error that decides on stopping: on the validation data where there are any, else the training error."""
    return training_error.copy() if validation is None else _mean_square(_evaluate(weights, validation))


def _linearise(weights, parts, evaluated):
    """J'J and J'e over the number of residuals, of n networks, from what `_evaluate` returns."""
    size = sum(part.targets.size for part in parts)
    matrix = gradient = 0.0
    for part, (activations, residuals) in zip(parts, evaluated, strict=True):
        of_part = normal_equations(weights, part.inputs, activations, residuals)
        matrix, gradient = matrix + of_part[0], gradient + of_part[1]
    return matrix / size, gradient / size


def _damped_solution(matrix, mu, gradient):
    """Solve (matrix + mu 1) x = gradient of every network by Cholesky's factors.

    0 where rounding leaves it not positive definite: no progress, mu grows.
    """
    solution = np.zeros_like(gradient)
    damped = matrix + mu[:, None, None] * np.eye(matrix.shape[1])
    for network in range(len(matrix)):
        _, step, failed = dposv(damped[network].T, gradient[network], overwrite_a=True)
        if not failed:
            solution[network] = step
    return solution
