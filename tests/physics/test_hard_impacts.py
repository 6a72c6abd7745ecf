"""What the configuration warns of before a run, against the solver: crushed spheres and fast rebounds."""

import numpy as np
import pytest

from hopperopt import impact

FINE, COARSE, SPEED = 0.002, 0.004, 2.0


def test_coarse_sphere_on_a_fine_one(simulate, pair_law, wall_law):
    """The overlap of a fine sphere on the floor that a coarse one hits, without damping: as estimated.

    Above the estimate by a fifth at most: the energy is not shared evenly when the wall is stiffer.
    """
    pair, wall = pair_law(1.0, 0.0, 0.0), wall_law(1.0, 0.0, 0.0)
    sim = simulate(
        [[0.0, 0.0, FINE / 2], [0.0, 0.0, FINE + COARSE / 2 + 1e-6]],
        [FINE / 2, COARSE / 2],
        [[0.0, 0.0, 0.0], [0.0, 0.0, -SPEED]],
        walls={"floor": [[0, 0], [1, 0]]},
        pair=pair,
        wall=wall,
        time_step=1e-7,
    )
    sim.advance(20_000)
    estimate = impact.compression(FINE, COARSE, 2285.0, min(pair.modulus, wall.modulus), SPEED)
    assert estimate == pytest.approx(sim.max_overlap, rel=0.2)


def test_rising_fine_sphere_meets_a_falling_coarse_one(simulate, pair_law):
    """A head-on impact gives the fine sphere the estimated multiple of the fall's speed."""
    restitution, wall_restitution = 0.7, 0.2
    sim = simulate(
        [[0.0, 0.0, 0.0], [0.0, 0.0, (FINE + COARSE) / 2 + 1e-6]],
        [FINE / 2, COARSE / 2],
        [[0.0, 0.0, wall_restitution * SPEED], [0.0, 0.0, -SPEED]],
        pair=pair_law(restitution),
        time_step=1e-7,
    )
    sim.advance(20_000)
    speed = np.abs(sim.by_identity(sim.spheres.velocity)[0, 2])
    estimate = impact.rebound((FINE, FINE, COARSE), restitution, wall_restitution)
    assert speed / SPEED == pytest.approx(estimate, rel=0.01)
    chain = impact.rebound((0.002, 0.003, 0.004), restitution, wall_restitution)
    assert chain > estimate  # by way of the intermediate one
