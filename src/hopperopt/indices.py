"""Indices of segregation and of the flow that are in use elsewhere, from the events of one run.

With the mass fractions m of a size class in the W windows of M, its share m_0 of the batch and the counting
variance s^2 of each window:

- relative standard deviation S / m_0, S^2 = sum (m - mean m)^2 / (W - 1) (Poux et al., Powder Technology 68,
  1991, 213-234); sqrt(mean s^2) / m_0 is what a random mixture has
- Lacey's index (S_0^2 - S^2) / (S_0^2 - S_R^2): 0 for separated sizes, S_0^2 = m_0 (1 - m_0), and 1 for a
  random mixture (Lacey, Journal of Applied Chemistry 4, 1954, 257-268); its variance S_R^2 is here the mean
  of s^2, since the spheres' masses differ
- largest deviation: max |m - m_0|
- the squared objective, its noise taken off, without the window at M = 1 and weighted by the windows' masses
- residence order: Spearman's rank correlation of height at the opening and exit time, 1 where what was filled
  in first leaves first (mass flow), lower where upper layers overtake (funnel flow; Nedderman, Statics and
  Kinematics of Granular Materials, 1992)
"""

import numpy as np

from hopperopt import outflow

# Variables by name: what they are; all without unit, by size class but the last.
OF_SIZES = {
    "relative_deviation": "standard deviation of the mass fraction over M, relative to the batch",
    "random_deviation": "relative standard deviation of a random mixture, from the counting variance",
    "lacey_index": "Lacey's mixing index of the outflow: 0 for separated sizes, 1 for a random mixture",
    "largest_deviation": "largest deviation of the mass fraction from the batch",
    "U_without_end": "objective squared without the window at M = 1, less the counting variance",
    "U_by_mass": "objective squared, windows weighted by their mass, less the counting variance",
}
ORDER = "residence_order"
LONG_NAMES = OF_SIZES | {
    ORDER: "rank correlation of height at the opening and exit time: 1 is first in, first out"
}


def of_outflow(mass_fraction: np.ndarray, variance: np.ndarray, target: np.ndarray) -> dict[str, np.ndarray]:
    """The indices of OF_SIZES, each (size class,), of one run.

    mass_fraction, variance (size class, M): the outflow and its counting variance; target (size class,): m_0.
    """
    deviation = mass_fraction - target[:, None]
    square, random = np.var(mass_fraction, axis=-1, ddof=1), np.mean(variance, axis=-1)
    separated = target * (1 - target)
    corrected = deviation**2 - variance
    return {
        "relative_deviation": np.sqrt(square) / target,
        "random_deviation": np.sqrt(random) / target,
        "lacey_index": (separated - square) / (separated - random),
        "largest_deviation": np.abs(deviation).max(axis=-1),
        "U_without_end": corrected[:, :-1].mean(axis=-1),
        "U_by_mass": corrected @ np.diff(outflow.EDGES),
    }


def residence_order(exit_time: np.ndarray, position: np.ndarray) -> float:
    """Rank correlation of height at the opening and exit time; NaN without two heights and two times.

    exit_time (particle,): s, NaN for what stayed and does not count; position (particle, 3): m, at
    the opening.
    """
    from scipy.stats import spearmanr  # slow to import

    left = np.isfinite(exit_time)
    heights, times = position[left, 2], exit_time[left]
    if min(np.unique(heights).size, np.unique(times).size) < 2:
        return np.nan
    return float(spearmanr(heights, times).statistic)
