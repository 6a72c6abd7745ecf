"""The expected cost of a simulation, against runs of the two hoppers, and what the workflow grants."""

from pathlib import Path

import pytest

from hopperopt import config, cost

ROOT = Path(__file__).parents[2]

# Steps and particle-steps of runs: the means of three to six of each.
MEASURED = {
    (): {"exp_08": (36_900, 3.30e8), "exp_15": (36_750, 3.32e8), None: (37_250, 3.44e8)},
    ("config/ci.yaml",): {"exp_01": (29_750, 5.45e7), "exp_06": (30_000, 5.46e7), "exp_08": (30_750, 5.68e7)},
}


def case(name, *files, **changes):
    study = config.parse(config.load([ROOT / "config.yaml", *(ROOT / file for file in files)], changes))
    return study.simulation_case(dict(study.experiments()).get(name), name or "bare", 1)


@pytest.mark.parametrize("files", MEASURED)
def test_expected_steps_are_those_of_runs(files):
    for name, (steps, particle_steps) in MEASURED[files].items():
        expected = cost.expected(case(name, *files))
        assert expected.steps == pytest.approx(steps, rel=0.1)
        assert expected.particle_steps == pytest.approx(particle_steps, rel=0.15)


def test_cost_follows_step_count_and_outlet():
    usual = cost.expected(case("exp_08"))
    finer = cost.expected(case("exp_08", simulation={"time_step_s": 2e-5}))
    assert finer.particle_steps == pytest.approx(2 * usual.particle_steps)
    wider = cost.expected(case("exp_08", hopper={"outlet_radius_mm": 25}))
    assert wider.steps < usual.steps


def test_no_flow_is_told_to_last_until_the_limit():
    """Beverloo's law has no rate for an outlet of less than k mean diameters."""
    blocked = case("exp_08")
    blocked["walls"]["gate"] = [[0, 0], [0.0026, 0]]
    assert cost.expected(blocked).steps == pytest.approx(10 / 4e-5, rel=0.1)


def test_snapshots_take_memory_up_to_the_time_limit():
    """Five hundred of 15,000 particles, 40 bytes for each."""
    plain, filmed = (cost.expected(case("exp_08"), interval) for interval in (None, 0.02))
    assert filmed.memory_mb - plain.memory_mb == pytest.approx(500 * plain.particles * 4e-5)


def test_granted_is_enough_for_the_dearest_on_a_slow_machine():
    costs = [cost.expected(case(name)) for name in ("exp_08", None)]
    granted = cost.granted(costs)
    assert granted["runtime"] * 60 > 4 * max(expected.seconds[1] for expected in costs)
    assert granted["mem_mb"] > 2 * max(expected.memory_mb for expected in costs)
    assert granted == cost.granted(reversed(costs))
