"""The choice of a design, and what draws of the surrogate leave of it."""

import numpy as np
import pytest

from hopperopt import optimum, outflow
from hopperopt.surrogate import gaussian, prediction
from hopperopt.surrogate.network import Ensemble, Network, Scaling

BOUNDS = np.array([[0.0, 1.0], [0.0, 10.0]])
PARAMS = {"select": "compromise", "explicit": None, "centre": {"a": 0.5, "b": 5.0}, "seed": 1}


def bowls(*centres):
    """An ensemble whose members' J_f and J_i grow with the first factor's distance from a centre each."""
    members = []
    for centre in centres:
        # |a - centre| in two steep logistic nodes, about: their sum is least between them.
        hidden = np.array([[40.0, 0, 0, -40 * (centre + 0.3)], [-40.0, 0, 0, 40 * (centre - 0.3)]])
        output = np.array([[0.1, 0.1, 0.01], [0.2, 0.2, 0.02]])
        members.append(
            Network(hidden, output, Scaling(np.zeros(3), np.ones(3)), Scaling(np.zeros(2), np.ones(2)))
        )
    return prediction.Predictor(("a", "b"), outflow.GRID, np.zeros(2), Ensemble(tuple(members)))


def test_choices_of_members_that_disagree_spread_over_what_they_prefer():
    found = optimum.spread(PARAMS, bowls(0.2, 0.8), BOUNDS, np.array([[0.5, 5.0]]))
    low, high = found["a"]
    assert low == pytest.approx(0.2, abs=0.2) and high == pytest.approx(0.8, abs=0.2)
    agreed = optimum.spread(PARAMS, bowls(0.2, 0.2), BOUNDS, np.array([[0.5, 5.0]]))
    assert np.ptp(agreed["a"]) == np.ptp(agreed["b"]) == 0
    assert optimum.spread(PARAMS, bowls(0.2), BOUNDS, np.array([[0.5, 5.0]])) is None
    assert optimum.spread(PARAMS | {"select": "explicit"}, bowls(0.2, 0.8), BOUNDS, np.zeros((1, 2))) is None


def test_what_two_designs_have_in_common_is_no_error_of_their_difference(synthetic):
    model = gaussian.fit(synthetic.training(3))
    predictor = prediction.Predictor(tuple(synthetic.factors), outflow.GRID, synthetic.batch, model)
    far, near = [50.0, 30, 34], [50.0, 30.1, 34]
    rng = np.random.default_rng(1)
    alone = outflow.objective(predictor.draws(np.array([far]), 1000, rng), synthetic.batch)[:, 0].std(axis=0)
    neighbours = optimum.half_width(predictor, np.array([far, near]), rng)
    apart = optimum.half_width(predictor, np.array([far, [60.0, 50, 26]]), rng)
    assert (np.array(neighbours) < 0.7 * 1.645 * np.sqrt(2) * alone).all()
    assert (np.array(apart) > neighbours).all()
    assert optimum.half_width(bowls(0.2), np.zeros((2, 2)), rng) == [None, None]


def test_a_gain_within_its_uncertainty_is_warned_of():
    """The members agree on the selected design and differ at the centre, or the other way."""
    designs = np.array([[0.2, 5.0]])
    sure = optimum.choose(PARAMS, bowls(0.2, 0.2), BOUNDS, designs, bowls(0.2).objectives(designs))[1]
    assert sure["warning"] is None
    assert (
        sure["gain_over_centre"]["J_fine"]["half_width"]
        == 0
        < sure["gain_over_centre"]["J_fine"]["predicted"]
    )
    unsure = bowls(0.2, 0.6)
    said = optimum.choose(PARAMS, unsure, BOUNDS, designs, unsure.objectives(designs))[1]
    gain = said["gain_over_centre"]["J_fine"]
    assert gain["predicted"] < gain["half_width"]
    assert "the predicted gain of J_fine over the plan's centre" in said["warning"]


def test_bounds_move_outward_where_a_design_lies_on_them():
    assert optimum.widened(BOUNDS, np.array([0.5, 5.0])) is None
    moved = optimum.widened(BOUNDS, np.array([0.009, 9.95]))
    np.testing.assert_allclose(moved, [[-0.2, 1.0], [0.0, 12.0]])
