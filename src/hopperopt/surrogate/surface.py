"""Regressions of U on the design, without a curve: a quadratic surface, and the mean as its baseline."""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from hopperopt.surrogate.network import range_scaling


class Prediction(NamedTuple):
    """U of a new design and limits of 90 % for its simulated U; arrays (outputs,), NaN if unknown."""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


def quadratic(designs: np.ndarray, squares: np.ndarray, design: np.ndarray) -> Prediction:
    """Full quadratic in the factors; designs (n, factors), squares (n, outputs): U; design (factors,)."""
    scaling = range_scaling(designs)

    def terms(designs):
        scaled = scaling.normalise(designs)
        first, second = np.triu_indices(scaled.shape[1])
        return np.column_stack([np.ones(len(scaled)), scaled, scaled[:, first] * scaled[:, second]])

    return _regression(terms(designs), squares, terms(design[None])[0])


def mean(squares: np.ndarray) -> Prediction:
    """The mean of all U, squares (n, outputs), for whatever design."""
    return _regression(np.ones((len(squares), 1)), squares, np.ones(1))


def _regression(terms, squares, at):
    """Least squares of squares (n, outputs) on terms (n, p), at a new row (p,).

    Terms may be aliased, as those of the quadratic are in the orthogonal array: all NaN only where the new
    row asks for more than the rows tell.
    """
    inverse = np.linalg.pinv(terms)
    freedom = len(terms) - np.linalg.matrix_rank(terms)
    if freedom < 1 or not np.allclose(at @ inverse @ terms, at, atol=1e-8):
        return Prediction(*np.full((3, squares.shape[1]), np.nan))
    coefficients, weights = inverse @ squares, at @ inverse
    variance = np.sum((squares - terms @ coefficients) ** 2, axis=0) / freedom
    value, half = at @ coefficients, stdtrit(freedom, 0.95) * np.sqrt(variance * (1 + weights @ weights))
    return Prediction(value, value - half, value + half)
