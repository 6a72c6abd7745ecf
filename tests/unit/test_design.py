"""Plans: the orthogonal array, samplings within the ranges, names."""

from itertools import combinations, product

import numpy as np
import pytest

from hopperopt import design

FACTORS = {
    "theta_deg": (60, 57.5, 55, 52.5, 50),
    "length_mm": (50, 45, 40, 35, 30),
    "height_mm": (34, 32, 29.6, 28, 26),
}
RANGES = np.array([design.bounds(levels) for levels in FACTORS.values()])


def values(plan):
    """Factor values of a plan, (n, factors)."""
    return np.array([list(experiment.design.values()) for experiment in plan])


@pytest.mark.parametrize("count", [1, 3, 6])
def test_every_pair_of_levels_of_two_columns_comes_once(count):
    factors = {f"f{k}": tuple(range(10 * k, 10 * k + 5)) for k in range(count)}
    plan = design.l25(factors)
    assert len(plan) == 25
    for name, levels in factors.items():
        assert sorted(experiment.design[name] for experiment in plan) == sorted(5 * levels)
    for first, second in combinations(factors, 2):
        pairs = {(experiment.levels[first], experiment.levels[second]) for experiment in plan}
        assert pairs == set(product(range(1, 6), repeat=2))


def test_array_has_its_usual_order():
    plan = design.l25({f"f{k}": range(5) for k in range(6)})
    rows = {experiment.name: tuple(experiment.levels.values()) for experiment in plan}
    assert (rows["exp_02"], rows["exp_08"]) == ((1, 2, 2, 2, 2, 2), (2, 3, 4, 5, 1, 2))


def test_level_numbers_name_the_levels():
    for experiment in design.l25(FACTORS):
        for factor, number in experiment.levels.items():
            assert experiment.design[factor] == FACTORS[factor][number - 1]


def test_plan_holds_the_tightest_corner_of_the_ranges():
    assert {"theta_deg": 50.0, "length_mm": 50.0, "height_mm": 26.0} in [
        e.design for e in design.l25(FACTORS)
    ]
    assert len(design.corners(FACTORS)) == 8


def test_names_are_never_padded_anew():
    names = design.names(100)
    assert (names[0], names[98], names[99]) == ("exp_01", "exp_99", "exp_100")
    assert design.names(7) == names[:7]


def test_latin_hypercube_has_one_point_in_each_stratum():
    plan = design.lhs(FACTORS, 10, seed=3)
    strata = np.floor((values(plan) - RANGES[:, 0]) / np.diff(RANGES).T * 10)
    assert all(sorted(column) == list(range(10)) for column in strata.T)
    assert plan == design.lhs(FACTORS, 10, seed=3) != design.lhs(FACTORS, 10, seed=4)
    assert not plan[0].levels


def test_sobol_points_are_balanced():
    plan = values(design.sobol(FACTORS, 16, seed=1))
    assert (plan >= RANGES[:, 0]).all() and (plan <= RANGES[:, 1]).all()
    assert ((plan > RANGES.mean(axis=1)).sum(axis=0) == 8).all()


def test_centre_is_the_middle_level_in_any_order():
    assert design.centre(FACTORS) == {"theta_deg": 55.0, "length_mm": 40.0, "height_mm": 29.6}
    assert design.centre({"a": (3, 1, 2), "b": (10, 20)}) == {"a": 2.0, "b": 15.0}


def test_own_plan_may_have_spaces():
    plan = design.from_csv("experiment, a, b\ndry , 1, 2\nwet, 3, 4e1\n", {"a": (), "b": ()})
    assert plan == [design.Experiment("dry", {"a": 1.0, "b": 2.0}, {}), ("wet", {"a": 3.0, "b": 40.0}, {})]
