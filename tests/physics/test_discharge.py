"""The sensor, what happens to spheres that left, and the monitors."""

import numpy as np
import pytest

from hopperopt.dem.simulation import NotFinite

G = 9.81
DT = 4.0e-5
GATE = {"gate": [[0.5, 0.0], [0.6, 0.0]]}  # a gate out of the way


@pytest.mark.parametrize("height", [0.001, 0.0123, 0.05004, 0.3])
def test_exit_time_is_that_of_free_fall(simulate, height):
    """sqrt(2 h / g), interpolated within the step: to a thousandth of it."""
    back = [[0.0, 0.0, 0.5 * G * DT]]  # velocities live half a step before the positions
    sim = simulate([[0.0, 0.0, height]], 0.001, back, walls=GATE, gravity=G)
    sim.open("gate", sensor=0.0)
    expected = np.sqrt(2.0 * height / G)
    sim.advance(int(expected / DT))
    assert sim.count == 1 and np.isnan(sim.exit_time[0])
    sim.advance(2)
    assert sim.count == 0
    assert sim.exit_time[0] == pytest.approx(expected, abs=1e-3 * DT)


def test_clock_starts_with_the_opening(simulate):
    """Time spent before does not count, and nothing is taken out before."""
    sim = simulate([[0.0, 0.0, 0.01]], 0.001, [[0.0, 0.0, -1.0]], walls=GATE)
    sim.advance(500)
    assert sim.time == pytest.approx(500 * DT) and sim.count == 1
    sim.open("gate", sensor=-0.012)
    assert sim.time == 0.0
    sim.advance(500)
    assert sim.exit_time[0] == pytest.approx(0.002, abs=1e-9)  # it was at -0.01, a step of 4e-5 m at a time


def test_sensor_has_no_bounds(simulate):
    """The plane reaches out in r, and what passed it far off is timed as well."""
    sim = simulate([[3.0, 4.0, 0.01]], 0.001, [[0.0, 0.0, -1.0]], walls=GATE)
    sim.open("gate", sensor=0.0)
    sim.advance(300)
    assert sim.exit_time[0] == pytest.approx(0.01, rel=1e-9)


def test_sphere_acts_until_its_centre_crosses(simulate):
    """The lower of two pushes the upper until its centre passes the sensor, then no more."""
    pushed = {}
    for sensor in (0.0, -1.0):
        sim = simulate([[0.0, 0.0, 1e-4], [0.0, 0.0, 4.06e-3]], 0.002, [[0.0, 0.0, -1.0]] * 2, walls=GATE)
        sim.open("gate", sensor)
        pushed[sensor] = []
        for _ in range(4):
            sim.advance(1)
            pushed[sensor].append(sim.by_identity(sim.spheres.force)[1, 2])
    through = sim.by_identity(sim.spheres.position)[0, 2]
    assert -1e-4 < through < 0.0 < min(pushed[-1.0])
    assert pushed[0.0] == [*pushed[-1.0][:3], 0.0]  # it crossed in the third step


def test_spheres_that_left_meet_nobody(simulate):
    """Neighbours leave shortly after each other, at all angles: no force, no monitor moves.

    Over all phases of the lists' renewal.
    """
    radius = 0.001
    for rise in (0.0, 0.0006, 0.0012, 0.0019):
        beside = 1.0001 * np.sqrt(4.0 * radius**2 - rise**2)
        for start in np.arange(0.001, 0.003, 0.0001):
            position = [[0.0, 0.0, start], [beside, 0.0, start + rise], [0.1, 0.0, 0.5]]
            sim = simulate(position, radius, [[0.0, 0.0, -1.2]] * 3, walls=GATE, gravity=G)
            sim.open("gate", sensor=0.0)
            sim.advance(120)
            assert sim.count == 1
            assert sim.max_overlap == 0.0
            assert sim.max_speed_ratio <= 1.001  # the start is half a step old
            assert np.isnan(sim.by_identity(sim.spheres.position)[:2]).all()


def test_energy_is_that_of_the_spheres_inside(simulate):
    """From the very step in which another one left."""
    sim = simulate([[0.0, 0.0, 1e-3], [0.1, 0.0, 0.5]], 0.001, [[0.0, 0.0, -1.2]] * 2, walls=GATE, gravity=G)
    sim.open("gate", sensor=0.0)
    for _ in range(60):
        sim.advance(1)
        kinetic, potential, _ = sim.energy()
        expected = sim.count * (0.5 * 1.2**2 + G * 0.5) - (sim.count - 1) * G * (0.5 - 1e-3)
        assert (kinetic + potential) / sim.spheres.mass[0] == pytest.approx(expected, rel=1e-3)
    assert sim.count == 1


def test_hopper_runs_empty(simulate):
    """After the last sphere has left, at any phase of the lists' renewal, time goes on over nothing."""
    for start in np.arange(0.001, 0.004, 0.0001):
        sim = simulate([[0.0, 0.0, start]], 0.001, [[0.0, 0.0, -1.2]], walls=GATE, gravity=G)
        sim.open("gate", sensor=0.0)
        sim.advance(300)
        assert sim.count == 0
        assert sim.exit_time[0] == pytest.approx(start / 1.2, rel=0.02)


def test_all_that_was_filled_is_discharged(bed):
    """Every sphere once, in an order of time that starts at the bottom; mass out equals mass in."""
    height = bed.by_identity(bed.spheres.position)[:, 2]
    bed.open("gate", -0.012)
    left_before = 0
    while bed.count and bed.time < 3.0:
        bed.advance(500)
        gone = ~np.isnan(bed.exit_time)
        assert bed.count == 1200 - gone.sum()
        assert bed.exit_time[gone].max(initial=0.0) <= bed.time
        assert gone.sum() >= left_before
        left_before = gone.sum()
        inside = bed.by_identity(bed.spheres.position)
        assert np.isnan(inside[gone]).all() and (inside[~gone, 2] >= -0.012).all()
    assert bed.count == 0
    first, last = np.argsort(bed.exit_time)[[0, -1]]
    assert height[first] < 0.005 < height[last]
    assert bed.max_overlap < 0.3 and bed.max_speed_ratio < 2.0


def test_those_who_stay_remain_who_they_are(bed):
    """Rows close up and are sorted again when spheres have left: each keeps its own size, mass and motion."""
    names = ("radius", "mass", "position", "velocity", "spin")

    def states():
        return {name: bed.by_identity(getattr(bed.spheres, name)) for name in names}

    bed.open("gate", -0.012)
    while bed.count > 1000 and bed.time < 1.0:
        bed.advance(100)
    before, steps = states(), 0
    while bed.count > 990 or bed.rows > bed.count:
        bed.advance(1)
        steps += 1
        assert steps < 1000
    after, inside = states(), np.isnan(bed.exit_time)
    assert (after["radius"] == before["radius"])[inside].all()
    assert (after["mass"] == before["mass"])[inside].all()
    time = steps * bed.settings.time_step
    assert np.abs(after["position"] - before["position"])[inside].max() < 2.0 * time
    assert np.abs(after["velocity"] - before["velocity"])[inside].mean() < 2.0 * G * time
    assert np.abs(after["spin"] - before["spin"])[inside].mean() < 2.0 * G * time / 0.0015


def test_overlap_monitor_holds_the_deepest_impact(simulate, pair_law, wall_law, hertz):
    """Over the smaller radius; the largest of all so far, of pairs and of walls."""
    radii, speed, density = np.array([0.002, 0.001]), 0.6, 2285.0
    mass = density * 4.0 / 3.0 * np.pi * radii**3
    law = pair_law(1.0, 0.0)
    sim = simulate(
        [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0031]],
        radii,
        [[0.0, 0.0, speed], [0.0, 0.0, 0.0]],
        pair=law,
        time_step=1e-6,
    )
    sim.advance(2000)
    deep = hertz.deepest(speed, radii.prod() / radii.sum(), mass.prod() / mass.sum(), law.modulus)
    assert sim.max_overlap == pytest.approx(deep / 0.001, rel=1e-3)
    law = wall_law(1.0, 0.0)
    sim = simulate(
        [[0.1, 0.0, 0.0021]],
        0.002,
        [[0.0, 0.0, -speed]],
        walls={"floor": [[0, 0], [1, 0]]},
        wall=law,
        time_step=1e-6,
    )
    sim.advance(1000)
    deep = hertz.deepest(speed, 0.002, mass[0], law.modulus)
    assert sim.max_overlap == pytest.approx(deep / 0.002, rel=1e-3)


def test_speed_monitor_compares_with_free_fall(simulate):
    """1 in free fall with or without a start, whatever the direction; what is faster by k gives k."""
    thrown = [[1.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.0, 0.0, 0.0]]
    sim = simulate([[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [2.0, 0.0, 0.5]], 0.001, thrown, gravity=G)
    sim.advance(3000)
    assert sim.max_speed_ratio == pytest.approx(1.0, abs=1e-3)
    sim = simulate([[0.0, 0.0, 0.5]], 0.001, [[0.0, 0.0, -2.0]], gravity=G)
    sim.advance(1000)
    sim.spheres.velocity[0] *= 1.7
    sim.advance(1)
    assert sim.max_speed_ratio == pytest.approx(1.7, rel=1e-3)
    sim.spheres.velocity[0] *= 0.1
    sim.advance(10)
    assert sim.max_speed_ratio == pytest.approx(1.7, rel=1e-3)


def test_speed_monitor_takes_a_start_from_rest(simulate):
    """Nothing is faster than free fall from the first step on, also where all start at rest at one height."""
    sim = simulate([[0.0, 0.0, 0.5], [0.1, 0.0, 0.5]], 0.001, gravity=G)
    for steps in (1, 500):
        sim.advance(steps)
        assert sim.max_speed_ratio == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("field", ["position", "velocity"])
def test_what_is_no_number_stops_the_run(simulate, field):
    """A position that is NaN, or that ran away, is an error and not a result."""
    sim = simulate([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], 0.001)
    getattr(sim.spheres, field)[1, 1] = np.nan
    with pytest.raises(NotFinite):
        sim.advance(5)
    sim = simulate([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], 0.001)
    sim.spheres.velocity[0, 0] = 1e200
    with pytest.raises(NotFinite):
        sim.advance(5)
