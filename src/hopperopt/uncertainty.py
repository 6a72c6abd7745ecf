"""How well simulations know the objectives, and which differences between designs they can tell.

U_k = mean over M of [(m_k - m_k0)^2 - s^2/n] is the square of an objective J_k without the noise of the n
runs whose mean curve is m_k; it may be negative, and is never cut off. s^2 is the variance of one run: the
scatter between the runs, or for n = 1 the counting variance. With d^2 = (m_k - m_k0)^2 - s^2/n, not below 0,
and W windows of M the variance is

    Var U = [4/n sum d^2 s^2 + 2/(n (n - 1)) sum s^4] / W^2,

where the scatter s^2 is pooled at each M over all designs of several runs. With one run the counting variance
stands for s^2 and, being known, makes the second term 2 sum s^4.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from hopperopt import outflow

SIGMAS = float(ndtri(0.95))  # half-width of an interval of 90 %, in standard deviations
LEVEL = 0.05  # of one-sided tests
POWER = 0.8  # at which a difference counts as detectable


class Runs(NamedTuple):
    """What the runs of a design say of its outflow: arrays (..., size class, M), `number` (..., 1, 1)."""

    number: np.ndarray  # n, of the runs that are data points
    mean: np.ndarray  # mass fraction m_k(M), NaN without a run
    counting: np.ndarray  # counting variance of one run, mean of the runs
    scatter: np.ndarray  # variance between the runs, NaN with less than two

    @property
    def variance(self) -> np.ndarray:
        """s^2 of one run: the scatter, the counting variance where there is one run alone."""
        return np.where(self.number > 1, self.scatter, self.counting)


class Estimate(NamedTuple):
    """A squared objective, or a difference of two, with its variance; arrays of one shape."""

    square: np.ndarray
    variance: np.ndarray

    def interval(self) -> tuple[np.ndarray, np.ndarray]:
        """Limits of 90 %."""
        half = SIGMAS * np.sqrt(self.variance)
        return self.square - half, self.square + half

    def __sub__(self, other: "Estimate") -> "Estimate":
        """Difference of independent estimates."""
        return Estimate(self.square - other.square, self.variance + other.variance)

    def in_deviations(self) -> np.ndarray:
        """Square over its standard deviation."""
        return self.square / np.sqrt(self.variance)

    def p_below(self) -> np.ndarray:
        """One-sided p-value of "not below zero": small where the square is plainly negative."""
        return ndtr(self.in_deviations())

    def detectable(self, level: float | np.ndarray) -> np.ndarray:
        """Smallest true value that a one-sided test at a level finds four times of five (80 % power)."""
        return (ndtri(1 - level) + ndtri(POWER)) * np.sqrt(self.variance)


def of_runs(mass_fraction: np.ndarray, counting_variance: np.ndarray) -> Runs:
    """Join the runs of each design; arrays (..., replicate, size class, M), NaN for no data point."""
    valid = np.isfinite(mass_fraction).all(axis=(-2, -1), keepdims=True)
    number = valid.sum(axis=-3)

    def mean(values, count):
        total = np.where(valid, values, 0.0).sum(axis=-3)
        return np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)

    average = mean(mass_fraction, number)
    departure = (mass_fraction - average[..., None, :, :]) ** 2
    return Runs(number, average, mean(counting_variance, number), mean(departure, number - 1))


def stacked(designs: list[Runs]) -> Runs:
    """One `Runs` of several designs, along a first dimension."""
    return Runs(*map(np.stack, zip(*designs, strict=True)))


def pooled_variance(runs: Runs) -> np.ndarray:
    """s^2 of one run, pooled over all designs at each M: (size class, M), NaN where no design has two runs.

    runs: designs in the leading dimensions.
    """
    freedom = np.broadcast_to(np.maximum(runs.number - 1, 0), runs.scatter.shape)
    designs = tuple(range(runs.scatter.ndim - 2))
    total = np.where(freedom > 0, freedom * runs.scatter, 0.0).sum(axis=designs)
    freedom = freedom.sum(axis=designs)
    return np.divide(total, freedom, out=np.full_like(total, np.nan), where=freedom > 0)


def mean_variance(runs: Runs, pooled: np.ndarray) -> np.ndarray:
    """Variance of the mean curves m_k(M), (..., size class, M); pooled: see `pooled_variance`."""
    return _known(runs, pooled) / np.where(runs.number > 0, runs.number, np.nan)


def _known(runs, pooled):
    """The best that is known of s^2: pooled for designs of several runs, for others the counting variance."""
    return np.where(runs.number > 1, pooled, runs.counting)


def estimate(runs: Runs, target: np.ndarray, pooled: np.ndarray) -> Estimate:
    """U_k of designs, (..., size class), and its variance; NaN for a design without a run.

    target (size class,): mass fractions m_k0 of the batch; pooled (size class, M): see `pooled_variance`.
    """
    number = np.where(runs.number > 0, runs.number, np.nan)
    square = outflow.corrected_square(runs.mean, target, runs.variance / number)
    noise = _known(runs, pooled)
    departure = np.maximum((runs.mean - np.asarray(target)[:, None]) ** 2 - noise / number, 0.0)
    freedom = np.where(number > 1, number * (number - 1), 1.0)
    terms = 4 * departure * noise / number + 2 * noise**2 / freedom
    return Estimate(square, terms.sum(axis=-1) / terms.shape[-1] ** 2)


def holm(p: np.ndarray) -> np.ndarray:
    """P-values (n,) adjusted for their number after Holm; NaN stays and does not count."""
    p = np.asarray(p, dtype=float)
    adjusted, known = np.full_like(p, np.nan), np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    steps = p[order] * np.arange(len(order), 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted
