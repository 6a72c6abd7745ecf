"""Spheres scattered in the column: apart, inside, anywhere."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.stats import kstest

from hopperopt.packing import scatter

RADII = np.repeat([0.001, 0.0015, 0.002], 300)
COLUMN, BOTTOM = 0.02, 0.05


def column(solid_fraction=0.2, seed=1, radii=RADII):
    return scatter(radii, COLUMN, BOTTOM, solid_fraction, np.random.default_rng(seed))


@pytest.mark.parametrize("solid_fraction", [0.05, 0.2, 0.3])
def test_no_sphere_overlaps_another(solid_fraction):
    reach = RADII[:, None] + RADII
    gaps = pdist(column(solid_fraction)) - reach[np.triu_indices(len(RADII), 1)]
    assert gaps.min() >= 0.0


def test_spheres_lie_in_the_column():
    """Centres within the radius, lowest points above the bottom, as high as the fraction asks for."""
    position = column()
    assert np.hypot(position[:, 0], position[:, 1]).max() <= COLUMN
    assert (position[:, 2] - RADII).min() >= BOTTOM
    height = (4 / 3 * np.pi * RADII**3).sum() / (0.2 * np.pi * COLUMN**2)
    assert np.ptp(position[:, 2]) == pytest.approx(height, rel=0.02)


def test_every_size_is_spread_evenly_over_the_column():
    """Heights and squared distances from the axis are uniform, for each size (Kolmogorov and Smirnov)."""
    position = column()
    for size in np.unique(RADII):
        x, y, z = position[size == RADII].T
        assert kstest((x**2 + y**2) / COLUMN**2, "uniform").pvalue > 0.001
        assert kstest((z - z.min()) / np.ptp(z), "uniform").pvalue > 0.001


def test_same_seed_same_column():
    assert np.array_equal(column(), column())
    assert not np.array_equal(column(), column(seed=2))


def test_too_dense_a_column_is_refused():
    with pytest.raises(ValueError, match="no room"):
        column(0.6)
