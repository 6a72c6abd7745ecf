"""Choosing from a front."""

import numpy as np
import pytest

from hopperopt.select import compromise, knee, select

CENTRE = np.array([1.0, 1.0])


def bent_front(corner=0.3):
    """Two straight arms that meet at (corner, corner), where the knee is, between (0, 1) and (1, 0)."""
    arm = np.linspace(0, 1, 5)[:, None]
    return np.concatenate(
        [(1 - arm) * [0, 1] + arm * corner, ((1 - arm) * corner + arm * np.array([1, 0]))[1:]]
    )


@pytest.mark.parametrize("scale", [(1, 1), (1e-3, 50)])
def test_knee_is_the_corner_whatever_the_units_and_the_order(scale):
    front = bent_front() * scale + [0.01, 0.2]
    for order in (np.arange(9), np.random.default_rng(0).permutation(9)):
        index, rule, warning = select("knee", front[order], CENTRE)
        assert order[index] == 4
        assert (rule, warning) == ("knee", None)


def test_compromise_weighs_by_the_centre():
    front = np.array([[1.0, 4.0], [2.0, 2.5], [4.0, 1.0]])
    assert compromise(front, [1.0, 1.0]) == 1
    assert compromise(front, [0.2, 5.0]) == 0
    assert compromise(front, [5.0, 0.2]) == 2
    assert select("compromise", front, [5.0, 0.2]) == (2, "compromise", None)


@pytest.mark.parametrize(
    ("front", "reason"),
    [
        ([[1.0, 2.0]], "1 point"),
        ([[1.0, 2.0], [2.0, 1.0]], "2 points"),
        ([[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]], "no length"),
        ([[0.0, 1.0], [0.8, 0.7], [1.0, 0.0]], "bulges"),
        ([[0.0, 1.0], [0.25, 0.75], [0.6, 0.4], [1.0, 0.0]], "bulges"),
    ],
)
def test_without_a_knee_the_compromise_with_a_warning(front, reason):
    index, rule, warning = select("knee", front, CENTRE)
    assert index == compromise(np.array(front), CENTRE)
    assert rule == "compromise"
    assert reason in warning


def test_points_beyond_the_chord_are_no_knee():
    """Farther from the chord than the true knee, but on the wrong side."""
    front = np.array([[0.0, 1.0], [0.3, 0.6], [0.95, 0.5], [1.0, 0.0]])
    assert knee(front) == (1, None)


def test_front_shorter_than_the_uncertainty_has_no_knee():
    front = bent_front() * [0.003, 0.004] + [0.010, 0.012]
    index, rule, warning = select("knee", front, [1.0, 2.0], np.array([0.0035, 0.0045]))
    assert (index, rule) == (compromise(front, [1.0, 2.0]), "compromise")
    assert "the front is shorter than the predictions' uncertainty (J_f spans 0.003" in warning
    assert "0.0045" in warning


@pytest.mark.parametrize("error", [None, [0.0035, 0.0035], [0.0025, 0.0045], [np.nan, np.nan]])
def test_front_longer_than_the_uncertainty_in_one_objective_keeps_its_knee(error):
    front = bent_front() * [0.003, 0.004] + [0.010, 0.012]
    error = None if error is None else np.array(error)
    assert select("knee", front, CENTRE, error) == (4, "knee", None)


def test_unknown_rule_is_refused():
    with pytest.raises(ValueError, match="'best' is not allowed"):
        select("best", bent_front(), CENTRE)
