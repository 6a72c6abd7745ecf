"""From the particles' exit times to the outflow's composition, its counting noise and the objectives.

M is the mass that has left over all that leaves. Each particle's mass leaves evenly over its own interval of
M, so the cumulative mass C_k(M) of size class k is piecewise linear, and the mass fraction of the class in a
window [a, b] of M is m_k = (C_k(b) - C_k(a)) / ((b - a) m_tot).
"""

from typing import NamedTuple

import numpy as np

SIZE_CLASSES = ("fine", "intermediate", "coarse")
GRID = np.arange(21) / 20
# Windows of M - 0.025 to M + 0.025, cut to 0 and 1: each begins where the one before it ends.
EDGES = np.concatenate([[0.0], np.arange(1, 40, 2) / 40, [1.0]])


class Outflow(NamedTuple):
    """Composition of the outflow over M; arrays (size class, 21)."""

    mass_fraction: np.ndarray
    counting_variance: np.ndarray


def outflow(exit_time: np.ndarray, diameter: np.ndarray, size_class: np.ndarray) -> Outflow:
    """Mass fractions m_k(M) at M = 0, 0.05, ..., 1, and their counting variances.

    exit_time (particle): s, NaN for what never left and so belongs neither to M nor to the fractions;
    diameter (particle): m, one density; size_class (particle): 0, 1, 2. All NaN if nothing left.

    Counting variance of one run: s^2 = sum_s c_s w_s^2 (delta_ks - m_k)^2 / (sum_s c_s w_s)^2 with the count
    c_s (in part where a particle's interval is cut) and the particle mass w_s of class s in the window.
    """
    classes = np.arange(len(SIZE_CLASSES))
    left = np.flatnonzero(np.isfinite(exit_time))
    if not left.size:
        return Outflow(*np.full((2, classes.size, GRID.size), np.nan))
    order = left[np.argsort(exit_time[left], kind="stable")]
    # Particle masses in units of the largest one: the common density cancels.
    mass = (diameter[order] / diameter.max()) ** 3
    member = size_class[order] == classes[:, None]

    ends = np.concatenate([[0.0], np.cumsum(mass)])
    total = ends[-1]
    cumulative = np.stack([np.interp(EDGES, ends / total, _cumulated(mass * own)) for own in member])
    counts = np.stack([np.interp(EDGES, ends / total, _cumulated(own)) for own in member])
    class_mass = np.diff(cumulative)
    fraction = class_mass / (np.diff(EDGES) * total)
    return Outflow(fraction, _counting_variance(fraction, class_mass, np.diff(counts)))


def _cumulated(amount: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(amount)])


def _counting_variance(fraction: np.ndarray, class_mass: np.ndarray, count: np.ndarray) -> np.ndarray:
    """s^2 (class k, window) from mass fraction m_k, class mass c_s w_s and count c_s in the window."""
    # c_s w_s^2, zero for a class without particles in the window.
    weight = np.divide(class_mass**2, count, out=np.zeros_like(count), where=count > 0)
    difference = np.eye(len(fraction))[:, :, None] - fraction[:, None, :]
    return np.einsum("sw,ksw->kw", weight, difference**2) / class_mass.sum(axis=0) ** 2


def batch_fractions(diameter: np.ndarray, size_class: np.ndarray) -> np.ndarray:
    """Mass fractions m_k0 (size class) of the whole batch, for one density."""
    mass = np.bincount(size_class, weights=(diameter / diameter.max()) ** 3, minlength=len(SIZE_CLASSES))
    return mass / mass.sum()


def objective(mass_fraction: np.ndarray, target: np.ndarray | float) -> np.ndarray:
    """J = sqrt(mean over M of (m(M) - m_0)^2) of curves (..., M) with targets m_0 (...)."""
    return np.sqrt(np.mean((mass_fraction - np.asarray(target)[..., None]) ** 2, axis=-1))


def corrected_square(
    mass_fraction: np.ndarray, target: np.ndarray | float, variance: np.ndarray
) -> np.ndarray:
    """U = mean over M of [(m - m_0)^2 - s^2], unbiased for the curve's J^2 without noise; may be negative.

    mass_fraction (..., M): curves of simulations; target (...); variance (..., M): of mass_fraction, that is
    the counting variance for a single run and s^2/n for the mean of n runs.
    """
    return np.mean((mass_fraction - np.asarray(target)[..., None]) ** 2 - variance, axis=-1)


def signed_root(square: np.ndarray | float) -> np.ndarray:
    """sign(U) sqrt|U|: a corrected square as tables print it."""
    return np.sign(square) * np.sqrt(np.abs(square))
