"""What goes into a surrogate, rows of factors and M, and what is made of the curves that come out."""

import numpy as np

OUTPUTS = ("fine", "intermediate")


def rows(designs: np.ndarray, mass_fractions_discharged: np.ndarray) -> np.ndarray:
    """Inputs of the surrogate: every design at every M, the designs' order outside, M last.

    designs: (n, factors), in the factors' own units; mass_fractions_discharged: (m,), the M.
    Returns (n m, factors + 1).
    """
    designs = np.atleast_2d(np.asarray(designs, dtype=float))
    moments = np.asarray(mass_fractions_discharged, dtype=float)
    return np.column_stack([np.repeat(designs, len(moments), axis=0), np.tile(moments, len(designs))])


def curves(outputs: np.ndarray, moments: int) -> np.ndarray:
    """Arrange predictions at `rows`, (n m, outputs), as curves, (n, outputs, m); moments: m."""
    return outputs.reshape(-1, moments, outputs.shape[1]).swapaxes(1, 2)


def violation(outflow: np.ndarray) -> np.ndarray:
    """How far predicted mass fractions leave the possible: the worst over M of -m_f, -m_i and m_f + m_i - 1.

    outflow: (n, outputs, m). Returns (n,); positive means an impossible prediction (the sum says m_c < 0).
    """
    return np.maximum((-outflow).max(axis=(1, 2)), (outflow.sum(axis=1) - 1.0).max(axis=1))


def factor_grid(bounds: np.ndarray, points: int) -> np.ndarray:
    """Full factorial grid, both bounds included.

    bounds: (factors, 2); points: number of values per factor. Returns (points^factors, factors).
    """
    axes = [np.linspace(low, high, points) for low, high in np.asarray(bounds, dtype=float)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
