"""Coulomb friction: sliding that becomes rolling, the limit of a loaded contact, the incline."""

import numpy as np
import pytest

G = 9.81
RADIUS = 0.0015
MASS = 2285.0 * 4.0 / 3.0 * np.pi * RADIUS**3
FLOOR = {"floor": [[0.0, 0.0], [1.0, 0.0]]}
FINE = 5.0e-6  # s


@pytest.fixture
def resting(simulate, hertz):
    """One sphere on a floor, as deep in it as its weight (times `load`) presses it."""

    def run(law, time_step=FINE, load=1.0, gravity=None, radius=RADIUS, **options):
        weight = load * 2285.0 * 4.0 / 3.0 * np.pi * radius**3 * G
        height = radius - hertz.overlap(weight, radius, law.modulus)
        gravity = [0.0, 0.0, -load * G] if gravity is None else gravity
        return simulate(
            [[0.05, 0.02, height]],
            radius,
            walls=FLOOR,
            wall=law,
            time_step=time_step,
            gravity=gravity,
            **options,
        )

    return run


def surface_speed(sim):
    """Velocity (m/s) of the lowest point of the only sphere along x."""
    return sim.spheres.velocity[0, 0] - sim.spheres.spin[0, 1] * sim.spheres.position[0, 2]


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.5])
def test_sliding_becomes_rolling(resting, wall_law, friction):
    """A sphere set sliding rolls from mu g t / u0 = 2/7 on, at v / u0 = omega R / u0 = 5/7, for any mu."""
    start = 0.2
    sim = resting(wall_law(0.2, friction), velocity=[[start, 0.0, 0.0]], rolling="none")
    expected = 2.0 / 7.0 * start / (friction * G)
    slid = 0
    while surface_speed(sim) > 1e-4 * start:
        sim.advance(1)
        slid += 1
        assert slid * FINE < 2.0 * expected
    assert slid * FINE == pytest.approx(expected, rel=1e-3)
    sim.advance(round(expected / FINE))  # rolling goes on at that speed
    assert sim.spheres.velocity[0, 0] / start == pytest.approx(5.0 / 7.0, rel=1e-3)
    assert sim.spheres.spin[0, 1] * RADIUS / start == pytest.approx(5.0 / 7.0, rel=1e-3)
    assert sim.spheres.velocity[0, 1] == 0.0


def test_spinning_becomes_rolling(resting, wall_law):
    """A sphere set spinning on the spot rolls off with 2/7 of its surface speed."""
    start = 0.2
    sim = resting(wall_law(0.2, 0.5), spin=[[-start / RADIUS, 0.0, 0.0]], rolling="none")
    sim.advance(round(2.0 * 2.0 / 7.0 * start / (0.5 * G) / FINE))
    assert sim.spheres.velocity[0, 1] / start == pytest.approx(2.0 / 7.0, rel=1e-3)
    assert -sim.spheres.spin[0, 0] * RADIUS / start == pytest.approx(2.0 / 7.0, rel=1e-3)


@pytest.mark.parametrize("radius", [0.001, 0.0015, 0.002])
@pytest.mark.parametrize("restitution", [0.2, 0.7])
@pytest.mark.parametrize(("share", "slides"), [(0.95, False), (1.05, True)])
def test_loaded_sphere_rests_up_to_the_coulomb_limit(resting, wall_law, radius, restitution, share, slides):
    """Under 20 times its weight, at 4e-5 s: at rest at 0.95 of mu N, off with 0.05 mu N / m at 1.05.

    Rolling friction above the static one keeps the sphere from rolling away instead.
    """
    friction, load, dt = 0.5, 20.0, 4.0e-5
    pull = share * friction * load * G
    sim = resting(wall_law(restitution, friction, rolling=10.0), dt, load, radius=radius)
    sim.advance(2000)
    sim.settings = sim.settings._replace(gravity=np.array([pull, 0.0, -load * G]))
    sim.advance(2000)
    before = sim.spheres.position[0].copy()
    sim.advance(2500)
    assert not sim.spheres.spin.any()
    if slides:
        time = 4500 * dt
        assert sim.spheres.velocity[0, 0] == pytest.approx((pull - friction * load * G) * time, rel=0.02)
    else:
        assert np.abs(sim.spheres.position[0] - before).max() < 1e-9 * radius
        assert sim.wall_force("floor")[0] == pytest.approx(sim.spheres.mass[0] * pull, rel=1e-6)


@pytest.mark.parametrize(("share", "slides"), [(0.95, False), (1.05, True)])
def test_clamped_sphere_rests_up_to_the_coulomb_limit(simulate, wall_law, hertz, share, slides):
    """The same between two plates, where symmetry keeps the sphere from rolling: each plate holds mu N.

    N is what the plates feel, some 20 weights each; no rolling friction is needed.
    """
    friction, dt = 0.5, 4.0e-5
    law = wall_law(0.2, friction)
    deep = hertz.overlap(30.0 * MASS * G, RADIUS, law.modulus)
    gap = 2.0 * (RADIUS - deep)
    plates = {"floor": FLOOR["floor"], "lid": [[0.0, gap], [1.0, gap]]}
    sim = simulate([[0.05, 0.0, gap / 2.0]], RADIUS, walls=plates, wall=law, time_step=dt, rolling="none")
    sim.advance(10)
    load = -sim.wall_force("floor")[2]
    assert 15.0 < load / (MASS * G) < 30.0
    pull = share * 2.0 * friction * load / MASS
    sim.settings = sim.settings._replace(gravity=np.array([0.0, -pull, 0.0]))
    sim.advance(2000)
    before = sim.spheres.position[0].copy()
    sim.advance(500)
    assert np.abs(sim.spheres.spin).max() < 1e-9
    if slides:
        expected = -(pull - 2.0 * friction * load / MASS) * 2500 * dt
        assert sim.spheres.velocity[0, 1] == pytest.approx(expected, rel=0.02)
    else:
        assert np.abs(sim.spheres.position[0] - before).max() < 1e-9 * RADIUS


def test_sphere_on_an_incline_rests_rolls_or_slides(resting, wall_law):
    """Rests while tan a < mu_r, rolls while tan a < 3.5 mu_s - 2.5 mu_r, slides beyond; at 4e-5 s.

    Rolling: a = 5/7 g (sin a - mu_r cos a); sliding: a = g (sin a - mu_s cos a).
    """
    mu_s, mu_r, dt, steps = 0.3, 0.1, 4.0e-5, 2500
    speed = {}
    for tan in (0.08, 0.12, 0.4, 0.76, 0.84, 1.2):
        cos = 1.0 / np.sqrt(1.0 + tan**2)
        gravity = [G * tan * cos, 0.0, -G * cos]
        sim = resting(wall_law(0.2, mu_s, mu_r), dt, gravity=gravity)
        sim.advance(steps)
        speed[tan] = sim.spheres.velocity[0, 0] / (G * cos * steps * dt)
        slip = surface_speed(sim) / (G * cos * steps * dt)
        assert (abs(slip) < 0.005) == (tan < 3.5 * mu_s - 2.5 * mu_r), tan
    assert abs(speed[0.08]) < 1e-6
    for tan in (0.12, 0.4, 0.76):
        assert speed[tan] == pytest.approx(5.0 / 7.0 * (tan - mu_r), abs=0.005)
    for tan in (0.84, 1.2):
        assert speed[tan] == pytest.approx(tan - mu_s, abs=0.005)


@pytest.mark.parametrize("angle", [0.0, 77.0, 201.0])
@pytest.mark.parametrize("inside", [True, False])
def test_ball_rolls_down_a_cone_in_its_meridian_plane(simulate, wall_law, hertz, angle, inside):
    """On an insert or in a hopper, at 45 degrees and any azimuth: a = 5/7 g sin 45."""
    slope = np.sqrt(0.5)
    outward = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    side = -1.0 if inside else 1.0
    normal = slope * (side * outward + [0.0, 0.0, 1.0])
    downhill = slope * (side * outward - [0.0, 0.0, 1.0])
    walls = {"cone": [[0.05, 0.0], [0.15, 0.1]] if inside else [[0.05, 0.1], [0.15, 0.0]]}
    law = wall_law(0.2, 0.5)
    position = 0.1 * outward + [0.0, 0.0, 0.05]
    position += (RADIUS - hertz.overlap(MASS * G * slope, RADIUS, law.modulus)) * normal
    sim = simulate([position], RADIUS, walls=walls, wall=law, time_step=2.0e-5, gravity=G, rolling="none")
    sim.advance(2500)
    speed = 5.0 / 7.0 * G * slope * 2500 * 2.0e-5
    assert sim.spheres.velocity[0] == pytest.approx(speed * downhill, abs=0.002 * speed)
    assert sim.spheres.spin[0] == pytest.approx(
        speed / RADIUS * np.cross(normal, downhill), rel=0.002, abs=0.1
    )
