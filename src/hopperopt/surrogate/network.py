"""Feed-forward networks with one logistic hidden layer and linear outputs, many at a time.

The networks of a batch share their data and differ in their weights alone: arrays carry the networks as the
first axis and the data rows as the last. Products are `matmul`s of one network each, so that a network's
numbers are the same to the bit alone and in any batch.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import expit
from threadpoolctl import threadpool_limits

from hopperopt.surrogate import features

# Decorates what multiplies matrices: the bits of large products depend on the number of BLAS' threads.
one_thread = threadpool_limits.wrap(limits=1, user_api="blas")

CHUNK = 50_000  # rows predicted at a time, to bound the memory


class Weights(NamedTuple):
    """Weights of n networks; the last column of each layer is the bias, its input the constant 1."""

    hidden: np.ndarray  # (n, hidden, inputs + 1)
    output: np.ndarray  # (n, outputs, hidden + 1)


class Scaling(NamedTuple):
    """Normalisation of columns: (values - centre) / scale."""

    centre: np.ndarray
    scale: np.ndarray

    def normalise(self, values: np.ndarray) -> np.ndarray:
        """Normalise columns of (..., columns)."""
        return (values - self.centre) / self.scale

    def restore(self, values: np.ndarray) -> np.ndarray:
        """Undo `normalise`."""
        return values * self.scale + self.centre


class Network(NamedTuple):
    """One trained network together with the scaling of its inputs and outputs."""

    hidden: np.ndarray  # (hidden, inputs + 1)
    output: np.ndarray  # (outputs, hidden + 1)
    inputs_scaling: Scaling
    outputs_scaling: Scaling

    @one_thread
    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n, outputs) at inputs (n, inputs), both in their own units."""
        weights = Weights(self.hidden[None], self.output[None])
        parts = [
            forward(weights, columns(self.inputs_scaling.normalise(inputs[first : first + CHUNK])))[1][0].T
            for first in range(0, len(inputs), CHUNK)
        ]
        return self.outputs_scaling.restore(np.concatenate(parts))


class Ensemble(NamedTuple):
    """Networks that each say what a curve may be; one alone is sure of itself."""

    members: tuple[Network, ...]

    def moments(self, designs: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance of the members' curves at designs (n, factors), (n, outputs, m) each."""
        curves = self._curves(designs, M)
        return curves.mean(axis=0), curves.var(axis=0)

    def draws(self, designs: np.ndarray, M: np.ndarray, number: int, rng: np.random.Generator) -> np.ndarray:
        """Curves of members drawn at random, (number, n, outputs, m): one member for all designs."""
        return self._curves(designs, M)[rng.integers(len(self.members), size=number)]

    def _curves(self, designs, M):
        rows = features.rows(designs, M)
        return np.stack([features.curves(member.predict(rows), len(M)) for member in self.members])


def range_scaling(values: np.ndarray) -> Scaling:
    """Scaling that maps each column's range onto [-1, 1]; a constant column is only shifted."""
    low, high = values.min(axis=0), values.max(axis=0)
    return Scaling((low + high) / 2, np.where(high > low, (high - low) / 2, 1.0))


def standard_scaling(values: np.ndarray) -> Scaling:
    """Scaling to mean 0 and standard deviation 1 of each column; a constant column is only shifted."""
    spread = values.std(axis=0)
    return Scaling(values.mean(axis=0), np.where(spread > 0, spread, 1.0))


def columns(inputs: np.ndarray) -> np.ndarray:
    """Turn normalised inputs (n, inputs) into what the layers take: (inputs + 1, n), the last row 1."""
    return np.ascontiguousarray(np.column_stack([inputs, np.ones(len(inputs))]).T)


def initial_weights(
    hidden_nodes: int, inputs: int, outputs: int, seeds: Sequence[np.random.SeedSequence]
) -> Weights:
    """Weights after Nguyen and Widrow (1990), one network per seed, each from its own seed alone.

    The hidden nodes' slopes have random directions and one length, 0.7 h^(1/inputs), doubled for the logistic
    function (it is half as steep in its argument as the tanh of their paper); their centres are spread evenly
    over the inputs' range [-1, 1]. Output weights are uniform in [-1, 1]. Returns Weights of len(seeds)
    networks.
    """
    hidden = np.empty((len(seeds), hidden_nodes, inputs + 1))
    output = np.empty((len(seeds), outputs, hidden_nodes + 1))
    length = 2 * 0.7 * hidden_nodes ** (1 / inputs)
    centres = np.linspace(-1, 1, hidden_nodes) if hidden_nodes > 1 else np.zeros(1)
    for network, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        slopes = rng.uniform(-1, 1, (hidden_nodes, inputs))
        slopes *= length / np.sqrt(np.sum(slopes**2, axis=1, keepdims=True))
        hidden[network, :, :-1] = slopes
        hidden[network, :, -1] = length * centres * np.sign(slopes[:, 0])
        output[network] = rng.uniform(-1, 1, (outputs, hidden_nodes + 1))
    return Weights(hidden, output)


def forward(weights: Weights, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Run n networks on the same rows.

    weights: of n networks; inputs: (inputs + 1, rows) from `columns`.
    Returns the layer's activations with a last row of ones, (n, hidden + 1, rows), and the outputs (n,
    outputs, rows).
    """
    count, hidden_nodes, _ = weights.hidden.shape
    activations = np.empty((count, hidden_nodes + 1, inputs.shape[1]))
    hidden = np.matmul(weights.hidden, inputs, out=activations[:, :-1])
    expit(hidden, out=hidden)
    activations[:, -1] = 1.0
    return activations, weights.output @ activations


def normal_equations(
    weights: Weights, inputs: np.ndarray, activations: np.ndarray, residuals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """J'J and J'r of n networks, J the derivatives of the residuals by the weights in the order of `flatten`.

    With a_j the activations (a_0 = 1), a_j' their slopes, x_i the inputs and v_kj the output weights, the
    derivative of output k is a_j by v_kj, 0 by v_lj of another output, and v_kj a_j' x_i by the hidden weight
    w_ji. Every product of two of them is a product of the basis functions b = (a_j, a_j' x_i) times output
    weights: one Gram matrix of the basis gives all of J'J, whatever the number of outputs.

    activations: (n, hidden + 1, rows) from `forward`; residuals: (n, outputs, rows).
    Returns (n, weights, weights) and (n, weights).
    """
    count, outputs, width = weights.output.shape
    hidden_nodes, inputs_count = width - 1, len(inputs)
    slopes = activations[:, :-1] * (1 - activations[:, :-1])
    basis = np.empty((count, width + hidden_nodes * inputs_count, inputs.shape[1]))
    basis[:, :width] = activations
    by_input = basis[:, width:].reshape(count, hidden_nodes, inputs_count, -1)
    np.multiply(slopes[:, :, None], inputs, out=by_input)
    gram = basis @ basis.swapaxes(1, 2)
    projected = residuals @ basis.swapaxes(1, 2)

    # v_kj for every hidden weight w_ji, (n, outputs, hidden * (inputs + 1))
    factor = np.repeat(weights.output[:, :, :-1], inputs_count, axis=2)
    size = hidden_nodes * inputs_count
    matrix = np.zeros((count, size + outputs * width, size + outputs * width))
    matrix[:, :size, :size] = gram[:, width:, width:] * (factor.swapaxes(1, 2) @ factor)
    gradient = np.empty((count, size + outputs * width))
    gradient[:, :size] = (factor * projected[:, :, width:]).sum(axis=1)
    for k in range(outputs):
        own = slice(size + k * width, size + (k + 1) * width)
        matrix[:, own, own] = gram[:, :width, :width]
        matrix[:, own, :size] = gram[:, :width, width:] * factor[:, k, None]
        matrix[:, :size, own] = matrix[:, own, :size].swapaxes(1, 2)
        gradient[:, own] = projected[:, k, :width]
    return matrix, gradient


def flatten(weights: Weights) -> np.ndarray:
    """Weights of n networks as (n, weights): the hidden layer row by row, then the output layer."""
    count = len(weights.hidden)
    return np.concatenate([weights.hidden.reshape(count, -1), weights.output.reshape(count, -1)], axis=1)


def unflatten(vectors: np.ndarray, hidden_nodes: int, inputs: int, outputs: int) -> Weights:
    """Undo `flatten` for networks of the given numbers of nodes."""
    size = hidden_nodes * (inputs + 1)
    return Weights(
        np.ascontiguousarray(vectors[:, :size]).reshape(-1, hidden_nodes, inputs + 1),
        np.ascontiguousarray(vectors[:, size:]).reshape(-1, outputs, hidden_nodes + 1),
    )
