"""A whole experiment: fill, settle, open, discharge, in a small hopper."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from hopperopt import config, experiment, outflow


def case(seed=1, diameters=(0.002, 0.003, 0.004)):
    """1,500 spheres of the study's materials in a bare hopper of 24 mm outlet and 44 mm cylinder."""
    pilot = config.parse({}).simulation_case(None, "pilot", 1)
    pilot["walls"]["hopper"] = [[0.012, 0.0], [0.022, 0.010], [0.022, 0.16]]
    pilot["walls"]["gate"] = [[0.0, 0.0], [0.012, 0.0]]
    pilot["filling"] |= {"level": 0.035, "column_radius": 0.020, "column_bottom": 0.040}
    pilot["particles"] |= {"diameters": list(diameters), "counts": [500, 500, 500]}
    return pilot | {"seed": seed}


@pytest.fixture(scope="module")
def ternary():
    """One run of 1,500 spheres of three sizes."""
    return experiment.run(case())


@pytest.fixture(scope="module")
def one_size():
    """Runs of the null experiment: spheres of one size, labelled as three classes."""
    return [experiment.run(case(seed, diameters=(0.003, 0.003, 0.003))) for seed in (1, 2, 3)]


def test_experiment_is_complete_and_within_the_monitors(ternary):
    assert ternary["status"].item() == "complete"
    assert ternary["residual_count"].item() == 0
    assert ternary["lost_particles"].item() == 0
    assert 0.02 < ternary["filling_level"].item() < 0.06
    assert 0.0 < ternary["filling_time"].item() < 1.0


@pytest.mark.full
def test_threads_change_no_bit_of_an_experiment(ternary):
    """Threads wait for each other at every step: slow wherever the cores are busy."""
    again = experiment.run(case(), threads=3)
    assert again.drop_attrs(deep=False).identical(ternary.drop_attrs(deep=False))


def test_all_mass_that_was_filled_leaves(ternary):
    """Every sphere passes the sensor once; the windows' masses add up to the batch's 8 : 27 : 64."""
    times = ternary["exit_time"].values
    assert np.isfinite(times).all()
    assert times.max() == pytest.approx(ternary["discharge_time"].item())
    flow = outflow.outflow(times, ternary["diameter"].values, ternary["size_class"].values)
    total = (flow.mass_fraction * np.diff(outflow.EDGES)).sum(axis=1)
    assert total == pytest.approx(np.array([8, 27, 64]) / 99, rel=1e-12)


def test_spheres_leave_through_the_outlet(ternary):
    """At the opening all lie above the gate and within the hopper; when half has left, half is missing."""
    opening, half = ternary["position_opening"].values, ternary["position_half"].values
    radius = ternary["diameter"].values / 2
    wall = np.interp(opening[:, 2], [0.0, 0.010, 1.0], [0.012, 0.022, 0.022])
    assert (np.hypot(opening[:, 0], opening[:, 1]) < wall).all()
    assert (opening[:, 2] > 0.7 * radius).all()
    mass = radius**3
    assert mass[np.isnan(half[:, 0])].sum() / mass.sum() == pytest.approx(0.5, abs=0.05)


def test_same_seed_same_run_another_seed_another(ternary):
    again = experiment.run(case())
    for name, variable in ternary.data_vars.items():
        np.testing.assert_array_equal(variable.values, again[name].values, err_msg=name)
    assert not np.array_equal(experiment.run(case(2))["exit_time"], ternary["exit_time"])


def test_null_experiment_has_a_flat_outflow(one_size):
    """Equal spheres cannot segregate by their labels: m_k is 1/3 within the counting noise at every M.

    The squared deviations over their counting variance average to one; over three runs, two free classes and
    21 windows the average scatters by about 0.15.
    """
    ratios = []
    for run in one_size:
        assert run["status"].item() == "complete"
        flow = outflow.outflow(run["exit_time"].values, run["diameter"].values, run["size_class"].values)
        ratios.append((flow.mass_fraction - 1 / 3) ** 2 / flow.counting_variance)
    assert 0.5 < np.mean(ratios) < 1.5


def test_closed_outlet_is_reported_as_jammed():
    """An outlet narrower than a sphere lets none through: no data point."""
    narrow = case()
    narrow["walls"]["hopper"][0][0] = narrow["walls"]["gate"][1][0] = 0.0015
    narrow["discharge"]["idle_limit"] = 0.05
    run = experiment.run(narrow)
    assert run["status"].item() == "jammed"
    assert run["residual_mass_fraction"].item() > 0.5


def test_time_limit_is_reported_as_incomplete():
    short = case()
    short["discharge"]["time_limit"] = 0.05
    assert experiment.run(short)["status"].item() == "incomplete"


def test_unsettled_bed_is_reported():
    hasty = case()
    hasty["filling"]["settling_limit"] = 0.05
    assert experiment.run(hasty)["status"].item() == "unsettled"


def test_explosion_is_reported_by_the_monitors():
    """Far above the stable time step the spheres fly apart; the run returns, and says so."""
    wild = case()
    wild["time_step"] = 4.0e-4
    run = experiment.run(wild)
    assert run["status"].item() == "monitor"


def test_cores_change_no_bit_of_what_ends_the_filling():
    """The centre of mass of the study's batch, large enough for BLAS to share a product among the cores."""
    full = experiment._Experiment(config.parse({}).simulation_case(None, "full", 1), None, 1, None)
    heights = set()
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            heights.add(full.height())
    assert len(full.mass) > 14_000
    assert len(heights) == 1


def test_spheres_that_fall_as_one_have_no_rate():
    """Three equal spheres on the gate fall side by side: the mass leaves within one step."""
    few = case(diameters=(0.003, 0.003, 0.003))
    few["particles"]["counts"] = [1, 1, 1]
    few["walls"]["hopper"], few["walls"]["gate"] = [[0.022, 0.0], [0.022, 0.16]], [[0.0, 0.0], [0.022, 0.0]]
    run = experiment.run(few)
    assert run["status"].item() == "complete" and np.isnan(run["discharge_rate"].item())
