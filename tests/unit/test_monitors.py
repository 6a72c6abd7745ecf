"""What is watched while a simulation runs."""

import numpy as np
import pytest

from hopperopt.monitors import Envelope, filling_level

HOPPER = [[0.01, 0.0], [0.03, 0.02], [0.03, 0.1]]


@pytest.mark.parametrize(
    ("place", "closed", "opened"),
    [
        ([0.0, 0.005, 0.001], 0, 0),
        ([0.02, 0.0, 0.005], 1, 1),  # beside the cone
        ([0.0, 0.031, 0.05], 1, 1),  # beside the cylinder
        ([0.0, 0.0, -0.001], 1, 0),  # below the outlet
        ([0.0, 0.5, -0.001], 1, 0),
        ([0.02, 0.0, 0.15], 1, 1),  # above the rim
        ([np.nan] * 3, 0, 0),  # it has left
    ],
)
def test_spheres_outside_the_walls_are_lost(place, closed, opened):
    for gate_closed, lost in ((True, closed), (False, opened)):
        envelope = Envelope(HOPPER, 2)
        envelope.sample(np.array([[0.0, 0.0, 0.05], place]), gate_closed)
        envelope.sample(np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 0.05]]), gate_closed)  # once is enough
        assert envelope.lost == lost


@pytest.mark.parametrize(
    ("insert", "inside", "outside", "level"),
    [
        (None, 0.02, 0.02, 0.02),
        ([[0.0, 0.0], [0.012, 0.01], [0.012, 0.03], [0.0, 0.03]], 0.03, 0.02, 0.02),  # a body
        ([[0.01, 0.0], [0.012, 0.0], [0.012, 0.03], [0.01, 0.03], [0.01, 0.0]], 0.02, 0.02, 0.02),
        # A ring: of ten rings of equal area one lies wholly inside it, eight wholly outside.
        ([[0.01, 0.0], [0.012, 0.0], [0.012, 0.03], [0.01, 0.03], [0.01, 0.0]], 0.011, 0.02, 0.019),
    ],
)
def test_the_level_is_that_of_the_rings_that_the_insert_leaves_free(insert, inside, outside, level):
    rng = np.random.default_rng(1)
    r = 0.03 * np.sqrt(rng.random(20_000))
    top = np.where(r < 0.011, inside, outside)
    position = np.stack([r, np.zeros_like(r), top - 0.001], axis=1)
    case = {"walls": {"hopper": HOPPER, "insert": insert}, "filling": {"level": 0.02}}
    found = filling_level(position, np.full(len(r), 0.001), np.full(len(r), 3), case)
    assert found == pytest.approx(level)
