"""What the scheme keeps: momentum, energy, and action equal to reaction."""

import numpy as np
import pytest

RADII = np.array([0.001, 0.0015, 0.002])
UNTURNED = np.eye(3)


def momenta(sim):
    """Linear and angular momentum about the origin, by the definitions."""
    m, r = sim.by_identity(sim.spheres.mass)[:, None], sim.by_identity(sim.spheres.radius)[:, None]
    x, v, w = (sim.by_identity(getattr(sim.spheres, name)) for name in ("position", "velocity", "spin"))
    return (m * v).sum(axis=0), (m * np.cross(x, v) + 0.4 * m * r**2 * w).sum(axis=0)


@pytest.fixture
def cluster(simulate):
    """40 spheres of three sizes flying into each other, spinning, without walls or weight; turned at will."""

    def make(turn=UNTURNED, **options):
        rng = np.random.default_rng(3)
        grid = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3)[:40] * 0.0041
        position = grid + rng.uniform(-1e-4, 1e-4, grid.shape) + [0.05, -0.02, 0.01]
        inward = position.mean(axis=0) - position
        velocity = 60.0 * inward + rng.normal(0.0, 0.2, position.shape) + [1.0, 2.0, 3.0]
        radius, spin = rng.choice(RADII, 40), rng.normal(0.0, 200.0, position.shape)
        return simulate(position @ turn.T, radius, velocity @ turn.T, spin=spin @ turn.T, **options)

    return make


@pytest.mark.parametrize("model", ["none", "cdt"])
def test_free_cluster_keeps_linear_and_angular_momentum(cluster, model):
    """Forces and torques come in pairs, and the arms add up to the distance of the centres: to round-off."""
    sim = cluster(rolling=model)
    linear, angular = momenta(sim)
    spin_before = sim.by_identity(sim.spheres.spin)
    sim.advance(600)
    assert sim.max_overlap > 0.02  # they did meet
    assert np.abs(sim.by_identity(sim.spheres.spin) - spin_before).max() > 100.0  # and rubbed
    after_linear, after_angular = momenta(sim)
    assert after_linear == pytest.approx(linear, abs=1e-12 * np.abs(linear).max())
    assert after_angular == pytest.approx(angular, abs=1e-12 * np.abs(angular).max())


def test_edem_keeps_linear_momentum(cluster):
    """Its brakes take spin out of each body on its own; the forces still cancel."""
    sim = cluster(rolling="edem")
    linear, _ = momenta(sim)
    sim.advance(600)
    assert momenta(sim)[0] == pytest.approx(linear, abs=1e-12 * np.abs(linear).max())


@pytest.mark.parametrize("model", ["edem", "cdt"])
def test_no_direction_is_special(cluster, model):
    """The cluster turned in space moves as before, turned: forces, torques and springs are vectors."""
    turn = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)  # a rotation, no mirror
    plain, turned = cluster(rolling=model), cluster(turn, rolling=model)
    for sim in (plain, turned):
        sim.advance(80)
    assert plain.max_overlap > 0.02
    for name, scale in (("position", 1e-3), ("velocity", 1.0), ("spin", 1e3)):
        values, others = (sim.by_identity(getattr(sim.spheres, name)) for sim in (plain, turned))
        assert others == pytest.approx(values @ turn.T, abs=1e-10 * scale)


@pytest.fixture
def gas(simulate, pair_law, wall_law):
    """60 elastic frictionless spheres in a closed can, falling and bouncing."""

    def make(time_step, gravity=9.81):
        rng = np.random.default_rng(11)
        grid = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 2, np.arange(5)), axis=-1).reshape(-1, 3)
        grid = grid[np.hypot(grid[:, 0], grid[:, 1]) < 2.3][:60]
        position = grid * 0.0042 + [0.0, 0.0, 0.004]
        can = {"can": [[0.0, 0.0], [0.013, 0.0], [0.013, 0.03], [0.0, 0.03]]}
        return simulate(
            position,
            rng.choice(RADII, len(position)),
            rng.normal(0.0, 0.5, position.shape),
            walls=can,
            pair=pair_law(1.0, 0.0),
            wall=wall_law(1.0, 0.0),
            time_step=time_step,
            gravity=gravity,
            rolling="none",
        )

    return make


def test_elastic_frictionless_spheres_keep_their_energy(gas):
    """Kinetic, gravitational and elastic energy add up to the same sum all the time, contacts or not."""
    sim = gas(1.0e-6)
    sim.advance(1)
    energies = []
    for _ in range(400):
        sim.advance(50)
        energies.append(sim.energy())
    kinetic, potential, elastic = np.array(energies).T
    total = kinetic + potential + elastic
    assert elastic.max() > 0.03 * kinetic.max()
    assert np.ptp(potential) > 0.01 * kinetic.max()
    assert np.abs(total - total[0]).max() < 1e-4 * kinetic.max()


def test_energy_error_is_of_second_order(gas):
    """Leapfrog: a quarter of the error at half the step."""
    error = {}
    for step in (4.0e-6, 2.0e-6):
        sim = gas(step)
        totals = []
        for _ in range(500):
            sim.advance(round(8.0e-6 / step))
            totals.append(sum(sim.energy()))
        error[step] = np.std(totals)
    assert 3.0 < error[4.0e-6] / error[2.0e-6] < 5.5


def test_single_bounce_on_a_wall_keeps_the_energy(simulate, wall_law):
    """All the way through the contact, with friction-free elastic walls."""
    radius = 0.0015
    sim = simulate(
        [[0.1, 0.0, radius + 1e-3]],
        radius,
        walls={"floor": [[0.0, 0.0], [1.0, 0.0]]},
        gravity=9.81,
        wall=wall_law(1.0, 0.0),
        time_step=1.0e-6,
    )
    energies = []
    for _ in range(3000):
        sim.advance(10)
        energies.append(sim.energy())
    energies = np.array(energies)
    fall = sim.spheres.mass[0] * 9.81 * 1e-3
    assert energies[:, 2].max() > 0.9 * fall
    assert np.abs(energies.sum(axis=1) - energies[0].sum()).max() < 1e-3 * fall


def test_free_fall_keeps_the_energy_at_any_step(simulate):
    """Heights are taken where the velocities are, half a step back: then leapfrog's sum is exact."""
    sim = simulate([[0.0, 0.0, 1.0]], 0.001, [[1.0, 0.0, 2.0]], gravity=9.81)
    energies = []
    for _ in range(50):
        sim.advance(200)
        energies.append(sim.energy())
    kinetic, potential, elastic = np.array(energies).T
    assert np.ptp(potential) > 0.1 * kinetic.max() and not elastic.any()
    assert np.ptp(kinetic + potential) < 1e-12 * kinetic.max()


def test_a_contact_that_ended_holds_no_energy(simulate):
    """Spheres that rubbed, parted and meet again: elastic energy as of two that never met, in every phase."""
    radius = 0.002
    for phase in np.linspace(0.0, 1.0, 8):
        sim = simulate([[0.0, 0.0, 0.0], [0.0, 0.0, 0.00398]], radius, [[0.05, 0.0, 0.0], [0.0, 0.0, 0.0]])
        sim.advance(3)  # stretches the spring
        x, v, spheres = sim.spheres.position, sim.spheres.velocity, sim.spheres
        top, bottom = np.argsort(-x[:, 2])
        v[:], spheres.spin[:] = 0.0, 0.0
        v[top, 2] = 0.01  # apart, within each other's list
        sim.advance(40)
        assert sim.energy()[2] == 0.0
        n = (x[top] - x[bottom]) / np.linalg.norm(x[top] - x[bottom])
        v[:], v[top], spheres.spin[:] = 0.0, -0.01 * n, 0.0
        x[top] = x[bottom] + (2.0 * radius + 4.0e-6 + phase * 4.0e-7) * n
        fresh = simulate(x.copy(), radius, v.copy())
        met = 0
        for _ in range(15):
            sim.advance(1)
            fresh.advance(1)
            assert sim.energy()[2] == pytest.approx(fresh.energy()[2], rel=1e-6, abs=1e-30)
            met += fresh.energy()[2] > 0.0
        assert met


def test_walls_feel_what_the_spheres_feel(simulate):
    """The forces on all walls are minus the sum of the forces on all spheres (forces in pairs cancel)."""
    rng = np.random.default_rng(5)
    walls = {
        "can": [[0.02, 0.0], [0.02, 0.05]],
        "floor": [[0.0, 0.0], [0.02, 0.0]],
        "cone": [[0.0, 0.004], [0.01, 0.004], [0.0, 0.014]],
    }
    grid = np.stack(np.meshgrid(*[np.arange(-4, 5)] * 2, np.arange(4)), axis=-1).reshape(-1, 3)
    grid = grid[np.hypot(grid[:, 0], grid[:, 1]) < 4.1]
    position = grid * 0.0042 + [0.0, 0.0, 0.017]
    sim = simulate(
        position,
        rng.choice(RADII, len(position)),
        rng.normal(0.0, 0.3, position.shape),
        walls=walls,
        gravity=9.81,
    )
    seen = np.zeros(3)
    for _ in range(40):
        sim.advance(50)
        forces = {name: sim.wall_force(name) for name in walls}
        total = np.sum(list(forces.values()), axis=0)
        on_spheres = sim.spheres.force[: sim.rows].sum(axis=0)
        assert total == pytest.approx(-on_spheres, abs=1e-12 * max(np.abs(total).max(), 1.0))
        seen += [np.linalg.norm(forces[name]) > 0.0 for name in walls]
    assert (seen > 10).all()
