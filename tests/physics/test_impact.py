"""Single impacts against closed forms.

T1, T2 and T4: Chung and Ooi, Granular Matter 13 (2011) 643. Steps are fine here: 200 or more per contact.
"""

import numpy as np
import pytest

from hopperopt.dem.materials import youngs_modulus

FLOOR = {"floor": [[0.0, 0.0], [1.0, 0.0]]}
DENSITY = 2285.0
STEEL = (8.0e10, 0.3)  # shear modulus (Pa), Poisson's ratio: overlaps below 0.1 % of the radius


def shear_modulus(youngs, poisson):
    """G of a material given by E."""
    return youngs / youngs_modulus(1.0, poisson)


def mass(radius, density=DENSITY):
    return density * 4.0 / 3.0 * np.pi * radius**3


@pytest.fixture
def meet(simulate, hertz):
    """Two spheres, or one and a floor, moved through one impact. Returns the simulation, by then apart."""

    def run(law, speed, radii, steps=200, velocity=None, spin=None, density=DENSITY):
        radii = np.atleast_1d(radii)
        to_wall = len(radii) == 1
        m = mass(radii, density)
        m_eff = m[0] if to_wall else m[0] * m[1] / m.sum()
        r_eff = radii[0] if to_wall else radii[0] * radii[1] / radii.sum()
        dt = hertz.duration(speed, r_eff, m_eff, law.modulus) / steps
        axis = [0.0, 0.0, 1.0]
        if to_wall:
            position = [[0.0, 0.0, radii[0]]]
            velocity = [[0.0, 0.0, -speed]] if velocity is None else [velocity]
        else:
            position = np.outer([0.0, radii.sum()], axis)
            velocity = np.outer([speed / 2.0, -speed / 2.0], axis) if velocity is None else velocity
        sim = simulate(
            position,
            radii,
            velocity,
            walls=FLOOR if to_wall else None,
            pair=law,
            wall=law,
            time_step=dt,
            density=density,
            rolling="none",
            spin=spin,
        )
        sim.advance(4 * steps)
        return sim

    return run


def of(sim, values):
    """A sphere array in the order in which the spheres were given."""
    return sim.by_identity(values)


@pytest.mark.parametrize("restitution", [0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0])
@pytest.mark.parametrize("speed", [0.05, 3.0])
def test_rebound_speed_is_restitution_times_impact_speed(meet, pair_law, wall_law, restitution, speed):
    between = meet(pair_law(restitution), speed, [0.001, 0.002])
    v = of(between, between.spheres.velocity)[:, 2]
    assert (v[1] - v[0]) / speed == pytest.approx(restitution, rel=0.005)
    floor = meet(wall_law(restitution), speed, 0.0015)
    assert floor.spheres.velocity[0, 2] / speed == pytest.approx(restitution, rel=0.005)


def test_without_restitution_hardly_anything_rebounds(meet, pair_law, wall_law):
    between = meet(pair_law(0.0), 0.5, [0.001, 0.002])
    v = of(between, between.spheres.velocity)[:, 2]
    assert abs(v[1] - v[0]) < 0.01 * 0.5
    assert abs(meet(wall_law(0.0), 0.5, 0.0015).spheres.velocity[0, 2]) < 0.01 * 0.5


def follow(sim, steps):
    """Largest force (N) on sphere 0 in `steps` steps, and for how many of them there was one."""
    strongest, touching = 0.0, 0
    for _ in range(steps):
        sim.advance(1)
        force = np.linalg.norm(of(sim, sim.spheres.force)[0])
        strongest, touching = max(strongest, force), touching + (force > 0.0)
    return strongest, touching


def test_elastic_spheres_follow_hertz(simulate, pair_law):
    """T1: overlap 368.30 um, force 7108.2 N, 54.20 us."""
    limestone = (shear_modulus(2.0e10, 0.25), 0.25)
    dt = 54.2e-6 / 500
    sim = simulate(
        [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]],
        0.01,
        [[10.0, 0.0, 0.0], [-10.0, 0.0, 0.0]],
        time_step=dt,
        density=2500.0,
        pair=pair_law(1.0, 0.35, material=limestone),
        rolling="none",
    )
    force, steps = follow(sim, 600)
    assert sim.max_overlap * 0.01 == pytest.approx(368.30e-6, rel=1e-3)
    assert force == pytest.approx(7108.2, rel=1e-3)
    assert steps * dt == pytest.approx(54.20e-6, rel=5e-3)


def test_elastic_sphere_on_a_rigid_plane_follows_hertz(simulate, wall_law):
    """T2: overlap 52.123 um, force 7232.7 N, 767.05 us; a wall of infinite modulus."""
    alloy, rigid = (shear_modulus(4.0e10, 0.35), 0.35), (np.inf, 0.25)
    dt = 767.05e-6 / 500
    sim = simulate(
        [[0.3, 0.1, 0.1]],
        0.1,
        [[0.0, 0.0, -0.2]],
        walls=FLOOR,
        time_step=dt,
        density=1800.0,
        wall=wall_law(1.0, 0.0, particle=alloy, wall=rigid),
        rolling="none",
    )
    force, steps = follow(sim, 600)
    assert sim.max_overlap * 0.1 == pytest.approx(52.123e-6, rel=1e-3)
    assert force == pytest.approx(7232.7, rel=1e-3)
    assert steps * dt == pytest.approx(767.05e-6, rel=5e-3)


def test_sphere_on_a_soft_wall_is_softer_than_on_a_rigid_one(simulate, wall_law, hertz):
    """1/E* adds up over both bodies: equal materials halve the modulus of the rigid wall."""
    speed, radius = 0.5, 0.002
    equal = wall_law(1.0, 0.0, particle=(1.0e7, 0.25), wall=(1.0e7, 0.25))
    rigid = wall_law(1.0, 0.0, particle=(1.0e7, 0.25), wall=(np.inf, 0.25))
    assert equal.modulus == pytest.approx(rigid.modulus / 2.0)
    assert equal.modulus == pytest.approx(2.5e7 / (2.0 * (1.0 - 0.25**2)))
    assert equal.shear_modulus == pytest.approx(1.0e7 / (2.0 * (2.0 - 0.25)))
    assert rigid.shear_modulus == pytest.approx(1.0e7 / (2.0 - 0.25))
    for law in (equal, rigid):
        sim = simulate(
            [[0.0, 0.0, radius]], radius, [[0.0, 0.0, -speed]], walls=FLOOR, wall=law, time_step=5e-7
        )
        sim.advance(2000)
        expected = hertz.deepest(speed, radius, mass(radius), law.modulus) / radius
        assert sim.max_overlap == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("restitution", "bounces"), [(0.9, 3), (0.7, 3), (0.5, 2)])
def test_bounce_heights(simulate, wall_law, restitution, bounces):
    """h_k - R = (h_0 - R) e^(2k); later bounces are so slow that the weight matters during the contact."""
    radius, drop, dt = 0.002, 0.05, 1.0e-6
    sim = simulate(
        [[0.02, 0.0, radius + drop]],
        radius,
        walls=FLOOR,
        wall=wall_law(restitution),
        time_step=dt,
        gravity=9.81,
    )
    flights = np.sqrt(2.0 * drop / 9.81) * restitution ** np.arange(bounces + 1)
    sim.advance(round(flights[0] / dt))
    for k in range(1, bounces + 1):
        sim.advance(round(flights[k] / dt))  # to the top of flight k, but for the short contacts before it
        heights = []
        for _ in range(40):
            sim.advance(100)
            heights.append(sim.spheres.position[0, 2] - radius)
        assert max(heights) == pytest.approx(drop * restitution ** (2 * k), rel=0.01)
        sim.advance(round(flights[k] / dt) - 4000)


@pytest.mark.parametrize("angle", [40.0, 50.0, 70.0])
def test_oblique_impact_that_slides_throughout(meet, wall_law, angle):
    """T4: aluminium oxide on a rigid wall, 3.9 m/s, angle from the normal.

    e_t = 1 - mu (1 + e) / tan, omega' = 2.5 mu (1 + e) v cos / R, and at the contact tan(rebound) =
    (tan - 3.5 mu (1 + e)) / e: friction's impulse is mu times the whole normal impulse.
    """
    mu, e, speed, radius = 0.092, 0.98, 3.9, 0.0025
    cos, tan = np.cos(np.radians(angle)), np.tan(np.radians(angle))
    law = wall_law(e, mu, particle=(shear_modulus(3.8e11, 0.23), 0.23), wall=(np.inf, 0.25))
    sideways = speed * cos * tan
    sim = meet(law, speed * cos, radius, steps=1000, velocity=[sideways, 0.0, -speed * cos], density=4000.0)
    v, w = sim.spheres.velocity[0], sim.spheres.spin[0]
    assert v[0] / sideways == pytest.approx(1.0 - mu * (1.0 + e) / tan, rel=0.01)
    assert w[1] == pytest.approx(2.5 * mu * (1.0 + e) * speed * cos / radius, rel=0.01)
    assert w[[0, 2]] == pytest.approx(0.0, abs=1e-9)
    # The surface at the contact slides on, in the sense of the impact.
    assert (v[0] - w[1] * radius) / v[2] == pytest.approx((tan - 3.5 * mu * (1.0 + e)) / e, rel=0.01)


def test_glancing_pair_slides_like_a_glancing_wall(meet, pair_law):
    """Two equal steel spheres, sliding throughout: dv_t = -+ mu (1 + e) v_n / 2, the same spin on both."""
    mu, e, speed, sideways, radius = 0.1, 0.7, 1.0, 0.4, 0.0015
    velocity = [[sideways, 0.0, speed / 2.0], [-sideways, 0.0, -speed / 2.0]]
    law = pair_law(e, mu, material=STEEL)
    sim = meet(law, speed, [radius, radius], steps=1000, velocity=velocity, density=7850.0)
    v, w = of(sim, sim.spheres.velocity), of(sim, sim.spheres.spin)
    impulse = mu * (1.0 + e) * speed / 2.0
    assert w[:, 1] == pytest.approx(np.full(2, -2.5 * impulse / radius), rel=0.01)
    # The spheres pass each other by a little meanwhile, and the normal turns.
    assert v[:, 0] == pytest.approx(np.array([1.0, -1.0]) * (sideways - impulse), abs=0.05 * impulse)


def test_equal_surface_speeds_exert_no_friction(meet, pair_law):
    """T7: spheres that roll on each other during the impact keep their spins and stay on their line."""
    spin = [[0.0, 40.0, 0.0], [0.0, -40.0, 0.0]]
    sim = meet(pair_law(0.5, 0.4), 0.2, [0.1, 0.1], spin=spin)
    assert of(sim, sim.spheres.spin) == pytest.approx(np.array(spin), rel=1e-12)
    assert of(sim, sim.spheres.velocity)[:, :2] == pytest.approx(0.0, abs=1e-12)


def test_spinning_sphere_of_another_size_drives_both(meet, pair_law):
    """Sliding throughout, unequal radii: the same tangential impulse J gives each spin 2.5 J / (m R)."""
    mu, e, speed, radii = 0.05, 0.8, 0.5, np.array([0.002, 0.001])
    law = pair_law(e, mu, material=STEEL)
    sim = meet(law, speed, radii, steps=1000, spin=[[0.0, 2000.0, 0.0], [0.0, 0.0, 0.0]])
    m = mass(radii)
    impulse = mu * (1.0 + e) * speed * m[0] * m[1] / m.sum()
    v, w = of(sim, sim.spheres.velocity), of(sim, sim.spheres.spin)
    assert w[:, 1] - [2000.0, 0.0] == pytest.approx(-2.5 * impulse / (m * radii), rel=0.01)
    # Sphere 0 lies below and turns towards +x at its top: it drags the other along and is pushed back.
    assert v[:, 0] == pytest.approx(np.array([-1.0, 1.0]) * impulse / m, rel=0.01)
