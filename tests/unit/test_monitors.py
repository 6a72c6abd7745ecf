"""What is watched while a simulation runs."""

import numpy as np
import pytest

from hopperopt.monitors import Envelope

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
