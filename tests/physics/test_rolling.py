"""Rolling friction: `edem` brakes each spin to rest, `cdt` turns both bodies against their relative spin."""

import numpy as np
import pytest

G = 9.81
RADIUS = 0.0015
MASS = 2285.0 * 4.0 / 3.0 * np.pi * RADIUS**3
INERTIA = 0.4 * MASS * RADIUS**2
FLOOR = {"floor": [[0.0, 0.0], [1.0, 0.0]]}
DT = 1.0e-5  # s


@pytest.fixture
def resting(simulate, hertz, wall_law):
    """One sphere at rest on a floor under its weight, with a spin or a velocity."""

    def run(model, rolling=0.2, friction=0.5, **options):
        law = wall_law(0.2, friction, rolling)
        height = RADIUS - hertz.overlap(MASS * G, RADIUS, law.modulus)
        return simulate(
            [[0.05, 0.0, height]],
            RADIUS,
            walls=FLOOR,
            wall=law,
            time_step=DT,
            gravity=G,
            rolling=model,
            **options,
        )

    return run


def test_edem_brakes_a_spin_to_rest_and_never_reverses_it(resting):
    """A top on the floor (spin along the normal): omega falls at mu_r N l / I and stays zero."""
    start = 50.0
    sim = resting("edem", spin=[[0.0, 0.0, start]])
    stop = INERTIA * start / (0.2 * MASS * G * RADIUS)
    spins = []
    for _ in range(round(1.2 * stop / DT)):
        sim.advance(1)
        spins.append(sim.spheres.spin[0].copy())
    spins = np.array(spins)
    assert not spins[:, :2].any()
    assert (np.diff(spins[:, 2]) <= 0.0).all() and (spins[:, 2] >= 0.0).all()
    assert spins[round(0.5 * stop / DT), 2] == pytest.approx(start / 2.0, rel=0.01)
    assert np.count_nonzero(spins[:, 2]) * DT == pytest.approx(stop, rel=0.01)
    assert spins[-1, 2] == 0.0


@pytest.mark.parametrize("model", ["cdt", "none"])
def test_without_edem_a_top_spins_on(resting, model):
    """`cdt` has no part along the normal, `none` no torque at all."""
    sim = resting(model, spin=[[0.0, 0.0, 50.0]])
    sim.advance(2000)
    assert sim.spheres.spin[0, 2] == pytest.approx(50.0, rel=1e-12)


@pytest.mark.parametrize(("model", "rolling"), [("edem", 0.2), ("edem", 0.05), ("cdt", 0.2), ("none", 0.2)])
def test_rolling_sphere_slows_down(resting, model, rolling):
    """A sphere that rolls without slip is slowed by 5/7 mu_r g by both models; not at all with `none`."""
    start, steps = 0.2, 5000
    sim = resting(model, rolling, velocity=[[start, 0.0, 0.0]], spin=[[0.0, start / RADIUS, 0.0]])
    sim.advance(steps)
    lost = 0.0 if model == "none" else 5.0 / 7.0 * rolling * G * steps * DT
    v, w = sim.spheres.velocity[0], sim.spheres.spin[0]
    assert v[0] == pytest.approx(start - lost, abs=0.01 * start * rolling)
    assert w[1] * RADIUS == pytest.approx(v[0], rel=2e-3)


def test_edem_brings_a_rolling_sphere_to_rest(resting):
    """It comes to rest and stays: nothing jitters."""
    start = 0.1
    sim = resting("edem", velocity=[[start, 0.0, 0.0]], spin=[[0.0, start / RADIUS, 0.0]])
    sim.advance(round(1.5 * start / (5.0 / 7.0 * 0.2 * G) / DT))
    assert np.abs(sim.spheres.velocity[0]).max() < 1e-12
    assert not sim.spheres.spin.any()
    assert sim.spheres.position[0, 0] - 0.05 == pytest.approx(
        start**2 / (2.0 * 5.0 / 7.0 * 0.2 * G), rel=0.01
    )


@pytest.fixture
def pressed_pair(simulate, pair_law):
    """Two frictionless spheres pushed into each other, moved by one step.

    Returns the changes of the spins per time (rad/s2), the force between them (N), radii and inertias.
    """

    def run(model, spin, radii=(0.002, 0.001), n=(0.0, 0.0, 1.0), rolling=0.1):
        radii = np.array(radii)
        position = np.outer([0.5, -0.5], n) * (radii.sum() - 2.0e-5)  # n points to sphere 0
        law = pair_law(0.7, 0.0, rolling)
        sim = simulate(position, radii, pair=law, time_step=1.0e-7, spin=spin, rolling=model)
        sim.advance(1)
        change = (sim.by_identity(sim.spheres.spin) - spin) / 1.0e-7
        load = np.linalg.norm(sim.by_identity(sim.spheres.force)[0])
        mass = 2285.0 * 4.0 / 3.0 * np.pi * radii**3
        return change, load, radii, 0.4 * mass * radii**2

    return run


def test_cdt_torque_is_opposite_on_both_bodies(pressed_pair):
    """mu_r N R* against omega_i - omega_j, without its component along n."""
    n = np.array([0.6, 0.0, 0.8])
    spin = np.array([[30.0, 20.0, -10.0], [5.0, -40.0, 20.0]])
    change, load, radii, inertia = pressed_pair("cdt", spin, n=n)
    relative = spin[0] - spin[1]
    direction = relative / np.linalg.norm(relative)
    expected = -0.1 * load * radii.prod() / radii.sum() * (direction - direction @ n * n)
    assert inertia[0] * change[0] == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())
    assert inertia[1] * change[1] == pytest.approx(-expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("model", ["edem", "cdt"])
def test_rolling_torque_at_a_wall(simulate, wall_law, hertz, model):
    """mu_r N l with l = R - delta against omega, for both models; spin across the normal."""
    deep, spin, dt = 2.0e-4, np.array([30.0, -40.0, 0.0]), 1.0e-8
    law = wall_law(1.0, 0.0, 0.1)
    sim = simulate(
        [[0.05, 0.0, RADIUS - deep]], RADIUS, walls=FLOOR, wall=law, time_step=dt, rolling=model, spin=[spin]
    )
    sim.advance(1)
    braking = 0.1 * hertz.force(deep, RADIUS, law.modulus) * (RADIUS - deep)
    expected = -braking / INERTIA * spin / np.linalg.norm(spin)
    assert (sim.spheres.spin[0] - spin) / dt == pytest.approx(expected, rel=1e-6)


def test_edem_brakes_each_body_along_its_own_spin(pressed_pair):
    """mu_r N l_i against omega_i on one, mu_r N l_j against omega_j on the other; n does not matter."""
    spin = np.array([[30.0, 20.0, -10.0], [5.0, -40.0, 20.0]])
    change, load, radii, inertia = pressed_pair("edem", spin)
    for i in range(2):
        arm = radii[i] - 1.0e-5  # R - delta / 2
        expected = -0.1 * load * arm * spin[i] / np.linalg.norm(spin[i])
        assert inertia[i] * change[i] == pytest.approx(expected, rel=1e-6)


def test_none_leaves_spins_alone(pressed_pair):
    change, *_ = pressed_pair("none", np.array([[30.0, 20.0, -10.0], [5.0, -40.0, 20.0]]))
    assert not change.any()


def test_edem_sums_over_all_contacts(simulate, wall_law, pair_law, hertz):
    """A sphere held between floor, lid and a neighbour is braked by all three, each with its own mu_r N l."""
    deep = 1.0e-5
    gap = 2.0 * (RADIUS - deep)
    walls = {"floor": FLOOR["floor"], "lid": [[0.0, gap], [1.0, gap]]}
    wall, pair = wall_law(0.2, 0.0, 0.25), pair_law(0.7, 0.0, 0.05)
    position = [[0.05, 0.0, gap / 2.0], [0.05, 2.0 * (RADIUS - deep), gap / 2.0]]
    sim = simulate(
        position,
        RADIUS,
        walls=walls,
        wall=wall,
        pair=pair,
        time_step=1.0e-8,
        spin=[[0.0, 0.0, 40.0], [0.0, 0.0, 0.0]],
    )
    sim.advance(1)
    on_plate = 0.25 * hertz.force(deep, RADIUS, wall.modulus) * (RADIUS - deep)
    on_other = 0.05 * hertz.force(2.0 * deep, RADIUS / 2.0, pair.modulus) * (RADIUS - deep)
    slower = (40.0 - sim.by_identity(sim.spheres.spin)[0, 2]) * INERTIA / 1.0e-8
    assert slower == pytest.approx(2.0 * on_plate + on_other, rel=1e-3)
    assert not sim.by_identity(sim.spheres.spin)[1].any()
