"""The force law of one contact: stiffness, damping, what friction refers to."""

from itertools import pairwise

import numpy as np
import pytest

from hopperopt.dem.laws import elastic_energy, hertz_mindlin

G = 9.81
RADIUS = 0.0015
MASS = 2285.0 * 4.0 / 3.0 * np.pi * RADIUS**3
FLOOR = {"floor": [[0.0, 0.0], [1.0, 0.0]]}


def law_of(law, overlap, velocity, spring, dt=4.0e-5):
    """The law for a contact with the floor: normal +z."""
    return hertz_mindlin(overlap, (0.0, 0.0, 1.0), velocity, spring, RADIUS, MASS, 1.0 / MASS, law, dt)


@pytest.mark.parametrize("restitution", [0.0, 0.2, 0.7, 1.0])
def test_friction_neither_exceeds_nor_falls_short_of_the_limit(wall_law, restitution):
    """A spring stretched beyond the limit transmits mu N, against it, moving or at rest, step after step."""
    law = wall_law(restitution, 0.4)
    for velocity in ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -0.3)):
        _, load, force, spring = law_of(law, 2.0e-5, velocity, (1.0e-3, 0.0, 0.0))
        assert force == pytest.approx((-0.4 * load, 0.0, 0.0), rel=1e-12)
        # Held there, the capped spring still carries all of it: nothing creeps.
        _, load, force, _ = law_of(law, 2.0e-5, (0.0, 0.0, 0.0), spring)
        assert force == pytest.approx((-0.4 * load, 0.0, 0.0), rel=1e-12)


def test_load_of_friction_knows_no_dashpot(wall_law):
    """The load is the same while approaching and leaving, positive while the normal force pulls."""
    law = wall_law(0.2, 0.4)
    approach, load, *_ = law_of(law, 1.0e-5, (0.0, 0.0, -0.3), (0.0, 0.0, 0.0))
    rest, load_at_rest, *_ = law_of(law, 1.0e-5, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    leaving, load_leaving, *_ = law_of(law, 1.0e-5, (0.0, 0.0, 0.3), (0.0, 0.0, 0.0))
    assert leaving < 0.0 < rest < approach
    assert load == load_at_rest == load_leaving == rest


def test_spring_stays_in_the_tangent_plane(wall_law):
    """Whatever a turning normal leaves along n is dropped from the spring, and never pushes."""
    n = np.array([0.6, 0.0, 0.8])
    _, _, force, spring = hertz_mindlin(
        2e-5, tuple(n), (0.01, 0.02, -0.03), (1e-7, 2e-7, 3e-7), RADIUS, MASS, 1.0 / MASS, wall_law(), 4e-5
    )
    assert np.dot(spring, n) == pytest.approx(0.0, abs=1e-20)
    assert np.dot(force, n) == pytest.approx(0.0, abs=1e-15)
    assert np.linalg.norm(spring) > 1e-7


def critical_share(restitution):
    """beta: damping over critical damping of a linear contact with this coefficient of restitution."""
    return -np.log(restitution) / np.hypot(np.log(restitution), np.pi)


@pytest.mark.parametrize("time_step", [1.0e-6, 4.0e-5])
@pytest.mark.parametrize("speed", [0.02, -0.02])
def test_normal_dashpot_acts_on_the_mean_of_old_and_new_velocity(simulate, wall_law, hertz, time_step, speed):
    """F = F_el - gamma (v_old + v_new) / 2, gamma = 2 sqrt(5/6) beta sqrt(S_n m)."""
    law, deep = wall_law(0.2), 1.0e-5
    sim = simulate(
        [[0.05, 0.0, RADIUS - deep]], RADIUS, [[0.0, 0.0, speed]], walls=FLOOR, wall=law, time_step=time_step
    )
    sim.advance(1)
    new = sim.spheres.velocity[0, 2]
    gamma = (
        2.0
        * np.sqrt(5.0 / 6.0)
        * critical_share(0.2)
        * np.sqrt(2.0 * law.modulus * np.sqrt(RADIUS * deep) * MASS)
    )
    expected = hertz.force(deep, RADIUS, law.modulus) - gamma * (speed + new) / 2.0
    assert MASS * (new - speed) / time_step == pytest.approx(expected, rel=1e-9)
    assert sim.wall_force("floor")[2] == pytest.approx(-expected, rel=1e-9)


@pytest.mark.parametrize("time_step", [1.0e-6, 4.0e-5])
def test_tangential_dashpot_acts_on_the_mean_of_old_and_new_velocity(simulate, wall_law, time_step):
    """F = -S_t xi - gamma_t (u_old + u_new) / 2, u the surface's velocity, whose inertia is 2/7 m.

    S_t = 8 G* sqrt(R delta) (Mindlin), gamma_t = 2 sqrt(5/6) beta sqrt(S_t m). Friction is out of reach.
    """
    law, deep, speed = wall_law(0.2, friction=100.0), 1.0e-6, 0.01
    sim = simulate(
        [[0.05, 0.0, RADIUS - deep]],
        RADIUS,
        [[speed, 0.0, 0.0]],
        walls=FLOOR,
        wall=law,
        time_step=time_step,
        rolling="none",
    )
    sim.advance(1)
    arm = RADIUS - deep
    new = sim.spheres.velocity[0, 0] - arm * sim.spheres.spin[0, 1]
    stiffness = 8.0 * law.shear_modulus * np.sqrt(RADIUS * deep)
    gamma = 2.0 * np.sqrt(5.0 / 6.0) * critical_share(0.2) * np.sqrt(stiffness * MASS)
    expected = -stiffness * speed * time_step - gamma * (speed + new) / 2.0
    assert -sim.wall_force("floor")[0] == pytest.approx(expected, rel=2e-3)  # l is shorter than R by 0.07 %


@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.5])
def test_stuck_contact_swings_at_mindlins_frequency(simulate, wall_law, hertz, restitution):
    """A sphere on a floor, pushed less than friction holds: a damped swing of mass 2/7 m on the spring S_t.

    omega0^2 = 7/2 S_t / m, damping ratio sqrt(5/6) beta sqrt(7/2); the swing's half periods and decay follow.
    """
    law, weight = wall_law(restitution, 0.5), MASS * G
    deep = hertz.overlap(weight, RADIUS, law.modulus)
    swing = np.sqrt(3.5 * 8.0 * law.shear_modulus * np.sqrt(RADIUS * deep) / MASS)
    ratio = np.sqrt(5.0 / 6.0 * 3.5) * (critical_share(restitution) if restitution < 1.0 else 0.0)
    damped, dt = swing * np.sqrt(1.0 - ratio**2), 0.001 / swing
    push = 0.02 * 0.5 * G / swing  # m/s: at most 2 % of the limit
    sim = simulate(
        [[0.05, 0.0, RADIUS - deep]],
        RADIUS,
        [[push, 0.0, 0.0]],
        walls=FLOOR,
        wall=law,
        time_step=dt,
        gravity=G,
        rolling="none",
    )
    surface = [push]
    for _ in range(9500):
        sim.advance(1)
        surface.append(sim.spheres.velocity[0, 0] - RADIUS * sim.spheres.spin[0, 1])
    surface = np.array(surface)
    crossings = np.flatnonzero(np.diff(np.sign(surface)))[:3]
    assert np.diff(crossings) * dt * damped == pytest.approx([np.pi, np.pi], rel=0.005)
    first, second = (np.abs(surface[a:b]).max() for a, b in pairwise(crossings))
    assert second / first == pytest.approx(np.exp(-np.pi * ratio / np.sqrt(1.0 - ratio**2)), rel=0.02)


def test_stored_energy_is_the_work_of_the_elastic_forces(wall_law, hertz):
    """Integrals of F_el over delta and of S_t xi over xi."""
    law, deep, stretch = wall_law(1.0), 3.0e-5, np.array([1.0e-5, -2.0e-5, 3.0e-5])
    steps = np.linspace(0.0, deep, 20_001)
    work = np.trapezoid(hertz.force(steps, RADIUS, law.modulus), steps)
    stored = elastic_energy(deep, (0.0, 0.0, 0.0), RADIUS, law)
    assert stored / work == pytest.approx(1.0, rel=1e-6)
    stiffness = 8.0 * law.shear_modulus * np.sqrt(RADIUS * deep)
    more = elastic_energy(deep, tuple(stretch), RADIUS, law) - stored
    assert more / (stiffness * stretch @ stretch / 2.0) == pytest.approx(1.0, rel=1e-9)


def test_surfaces_that_move_together_do_not_rub(simulate, pair_law, wall_law):
    """Lever arms are R - delta at a wall and R - delta / 2 between spheres, in the relative velocity too."""
    deep = 2.0e-4
    arm = RADIUS - deep
    sim = simulate(
        [[0.05, 0.0, arm]],
        RADIUS,
        [[arm * 30.0, -arm * 20.0, 0.0]],
        walls=FLOOR,
        wall=wall_law(1.0),
        time_step=1.0e-9,
        spin=[[20.0, 30.0, 0.0]],
    )
    sim.advance(1)
    force = sim.spheres.force[0]
    assert force[2] > 0.1 and np.abs(force[:2]).max() < 1e-12 * force[2]
    radii = np.array([0.002, 0.001])
    arms = radii - deep / 2.0
    spin = np.array([[20.0, 30.0, 7.0], [-20.0, -30.0, -3.0]]) / arms[:, None] * 1e-3
    sim = simulate(
        [[0.0, 0.0, 0.0], [0.0, 0.0, radii.sum() - deep]],
        radii,
        pair=pair_law(1.0),
        time_step=1.0e-9,
        spin=spin,
    )
    sim.advance(1)
    force = sim.by_identity(sim.spheres.force)
    assert force[1, 2] > 0.1 and np.abs(force[:, :2]).max() < 1e-12 * force[1, 2]
