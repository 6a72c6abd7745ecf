"""U, its variance and the tests of differences, on outflows whose composition over M is known."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from hopperopt import dataset, outflow, uncertainty, verdict, verify
from hopperopt.surrogate.features import OUTPUTS

DIAMETERS = np.array([2e-3, 3e-3, 4e-3])
TARGET = np.array([8, 27, 64]) / 99
POOL = 800  # particles of each size in a batch, not all of which leave


def composition(fine, intermediate):
    """Mass fractions (3, 21), one for each window: departures of m_f and m_i from the batch's, (21,) each."""
    curve = TARGET[:2, None] + np.stack([fine, intermediate])
    return np.vstack([curve, 1 - curve.sum(axis=0)])


def events(curve, runs, rng):
    """Classes of the particles in the order of their leaving, -1 for none more: (runs, particles).

    The particle that leaves at M belongs to class s with the probability that gives the mass fractions
    curve (3, 21) of M's window. Where M stands follows from the classes before, hence the repetition.
    """
    mass = DIAMETERS**3 / DIAMETERS[2] ** 3
    share = curve / mass[:, None]
    steps = (share / share.sum(axis=0)).cumsum(axis=0)
    total, draw = 0.6 * POOL * mass.sum(), rng.random((runs, 3 * POOL))
    done = np.tile(np.linspace(0, 1, 3 * POOL, endpoint=False), (runs, 1))
    for _ in range(6):
        window = np.clip(np.searchsorted(outflow.EDGES, done, side="right") - 1, 0, 20)
        drawn = (draw > steps[0][window]).astype(int) + (draw > steps[1][window])
        done = (mass[drawn].cumsum(axis=1) - mass[drawn]) / total
    return np.where(done < 1, drawn, -1)


def exit_times(classes):
    """A run's exit times, diameters and size classes: equal numbers of each, of which some have not left."""
    size_class = np.repeat([0, 1, 2], POOL)
    times = np.full(3 * POOL, np.nan)
    for k in range(3):
        moments = np.flatnonzero(classes == k)
        assert moments.size <= POOL
        times[k * POOL : k * POOL + moments.size] = moments
    return times, DIAMETERS[size_class], size_class


CAMPAIGNS, RUNS = 500, 3
# J against the noise of the mean curve as in the full study: three to five times it in the bare hopper.
PLAIN = composition(0.08 * np.sin(4 * outflow.GRID), 0.15 * np.cos(3 * outflow.GRID))
BETTER = composition(*(0.6 * (PLAIN - TARGET[:, None]))[:2])
MIXED = composition(*np.zeros((2, 21)))
TRUTH = {"selected": BETTER, "twin": PLAIN, "bare": PLAIN}
J = {case: outflow.objective(curve, TARGET)[:2] for case, curve in TRUTH.items()}


@pytest.fixture(scope="module")
def runs():
    """Runs as simulations leave them, by case; each campaign has RUNS of them."""
    rng = np.random.default_rng(7)
    names = ("exit_time", "diameter", "size_class")
    return {
        case: [
            xr.Dataset({n: ("particle", v) for n, v in zip(names, exit_times(classes), strict=True)})
            for classes in events(curve, CAMPAIGNS * RUNS, rng)
        ]
        for case, curve in TRUTH.items()
    }


@pytest.fixture(scope="module")
def verdicts(runs):
    """The verdicts of all campaigns in one table; every prediction is the truth."""
    tables = []
    for first in range(0, CAMPAIGNS * RUNS, RUNS):
        cases = [
            verdict.Case(name, name, truth(name), verify.curves(own[first : first + RUNS]))
            for name, own in runs.items()
        ]
        tables.append(verdict.judge(cases, TARGET))
    table = pd.concat(tables, ignore_index=True)
    table["U"] = np.sign(table["simulated"]) * table["simulated"] ** 2
    return table


def truth(case):
    return verdict.Prediction(*[J[case]] * 3, uncertainty.Estimate(J[case] ** 2, np.zeros(2)))


def near(values, expected):
    """Whether the mean of values is within three standard errors of what is expected."""
    return abs(np.mean(values) - expected) < 3 * np.std(values, ddof=1) / np.sqrt(len(values))


@pytest.mark.parametrize("case", TRUTH)
@pytest.mark.parametrize("objective", [0, 1])
def test_campaigns_tell_the_truth(verdicts, case, objective):
    """U is unbiased, its interval covers nine of ten, and a right prediction is found right."""
    own = verdicts[(verdicts["case"] == case) & (verdicts["objective"] == OUTPUTS[objective])]
    J_true = J[case][objective]
    assert len(own) == CAMPAIGNS
    assert near(own["U"], J_true**2)
    assert (own["raw_rms"] ** 2).mean() > J_true**2 + 3 * own["U"].std() / np.sqrt(CAMPAIGNS)
    assert 0.86 <= own["predicted"].between(own["low"], own["high"]).mean() <= 0.94
    assert abs(own["z"].mean()) < 0.15
    assert 0.85 < own["z"].std() < 1.15


def test_equal_designs_are_seldom_called_better_and_better_ones_often(verdicts):
    """The twin's two objectives share the 5 % after Holm; each of the selected design's has its own."""
    better = verdicts["better_than_bare"].astype(bool) & (verdicts["case"] != "bare")
    said = better.groupby([verdicts["case"], verdicts["objective"]]).mean()
    assert (said["twin"] <= 0.08).all()
    assert (said["selected"] > 0.5).all()
    assert ((verdicts["verdict"] == "better") == better).all()
    worse = (verdicts["verdict"] == "worse").groupby(verdicts["case"]).mean()
    assert worse["selected"] == 0 and worse["twin"] <= 0.08


def test_the_plans_data_set_has_the_same_truth(runs):
    """Replicates of equal designs, gathered: U of each; the noise between replicates is that of counting."""
    count = 100
    plan = pd.DataFrame({"theta_deg": np.arange(count)}, index=[f"exp_{n:02d}" for n in range(1, count + 1)])
    anywhere = ("particle", "xyz"), np.random.default_rng(9).random((3 * POOL, 3))
    own = {
        (plan.index[n // RUNS], n % RUNS + 1): run.assign(position_opening=anywhere)
        for n, run in enumerate(runs["bare"][: count * RUNS])
    }
    data = dataset.assemble(plan, own, {})
    for k, name in enumerate(OUTPUTS):
        of_size = data.sel(size_class=name)
        assert near(of_size["U_design"].values, J["bare"][k] ** 2)
        expected = of_size["U_design_variance"].values.mean()
        assert np.std(of_size["U_design"].values) ** 2 == pytest.approx(expected, rel=0.4)
        scatter, counting = (
            of_size["pooled_variance"],
            of_size["counting_variance"].mean(("experiment", "replicate")),
        )
        assert (scatter / counting).mean() == pytest.approx(1, abs=0.05)
    assert (data["U_design_counting_variance"] / data["U_design_variance"]).mean() == pytest.approx(
        1, abs=0.15
    )


def test_single_runs_without_segregation_scatter_around_zero():
    """n = 1: U below zero in half of the runs is no mistake, and its interval goes through zero."""
    flows = [
        outflow.outflow(*exit_times(classes)) for classes in events(MIXED, 300, np.random.default_rng(8))
    ]
    joined = uncertainty.of_runs(*(np.stack(part)[:, None] for part in zip(*flows, strict=True)))
    pooled = uncertainty.pooled_variance(joined)
    assert np.isnan(pooled).all()
    U = uncertainty.estimate(joined, TARGET, pooled)
    low, high = U.interval()
    for k in range(2):
        assert near(U.square[:, k], 0)
        assert 0.35 < np.mean(U.square[:, k] < 0) < 0.65
        assert np.mean((low[:, k] < 0) & (high[:, k] > 0)) > 0.86


def test_a_difference_is_detected_as_often_as_it_is_said():
    """With the true difference at `detectable`, four tests of five find it."""
    rng = np.random.default_rng(9)
    variance = np.full(4000, 0.09)
    size = uncertainty.Estimate(np.zeros(1), variance[:1]).detectable(uncertainty.LEVEL)
    found = uncertainty.Estimate(-size + 0.3 * rng.normal(size=4000), variance).p_below() < uncertainty.LEVEL
    assert found.mean() == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("case", ["selected", "other_1"])
def test_a_verdict_finds_a_difference_as_often_as_it_says(case):
    """With the true difference at `detectable`, four campaigns of five find it, after Holm where that is."""
    rng, objective = np.random.default_rng(9), "fine"
    spread = 1e-3

    def judged(shift):
        """The row of a case whose U differs by `shift` from that of the bare hopper; all others are equal."""
        cases = []
        for name in ("selected", *(f"other_{k}" for k in range(1, 6)), "bare"):
            square = 1e-3 + (shift if name == case else 0)
            curve = TARGET[:, None] + np.sqrt(square) + spread * rng.normal(size=(3, 1))
            known = np.full((3, 1), spread**2)
            runs = uncertainty.Runs(np.full((1, 1), 40), curve, 40 * known, 40 * known)
            cases.append(verdict.Case(name, name, verdict.NONE, runs))
        return verdict.judge(cases, TARGET).set_index(["case", "objective"]).loc[(case, objective)]

    size = judged(0)["detectable"]
    found = np.mean([judged(-size)["better_than_bare"] for _ in range(400)])
    assert 0.74 < found < 0.9


def test_designs_of_unequal_numbers_of_runs_pool_their_scatter_by_freedom():
    values = np.array([[1.0, 3.0, np.nan], [0.0, 4.0, 8.0], [5.0, np.nan, np.nan]])
    curves = np.broadcast_to(values[..., None, None], (3, 3, 1, 2))
    joined = uncertainty.of_runs(curves, np.ones_like(curves))
    assert joined.number.ravel().tolist() == [2, 3, 1]
    assert joined.variance[..., 0].ravel().tolist() == [2, 16, 1]
    # (1 * 2 + 2 * 16) / 3
    assert uncertainty.pooled_variance(joined).ravel() == pytest.approx([34 / 3] * 2)
    assert uncertainty.mean_variance(joined, np.full((1, 2), 6.0))[..., 0].ravel().tolist() == [3, 2, 1]


def test_holm():
    """Example of Holm's step-down: 4 p-values, the smallest times 4, the next times 3, never falling."""
    adjusted = uncertainty.holm(np.array([0.04, 0.01, np.nan, 0.03, 0.005]))
    np.testing.assert_allclose(adjusted, [0.06, 0.03, np.nan, 0.06, 0.02])
    assert uncertainty.holm(np.array([0.9, 0.8])).tolist() == [1, 1]
