"""A bed of the study's spheres at the study's time step, 4e-5 s: it settles, and then it is at rest."""

import numpy as np
import pytest

G = 9.81


def test_bed_is_stable_at_the_coarse_step(settled_bed):
    """No overlap or speed beyond the monitors' bounds on the way; nobody left the hopper."""
    x = settled_bed.by_identity(settled_bed.spheres.position)
    assert settled_bed.count == 1200
    assert settled_bed.max_overlap < 0.3
    assert settled_bed.max_speed_ratio < 2.0
    assert (x[:, 2] > 0.0).all() and (np.hypot(x[:, 0], x[:, 1]) < 0.03).all()


def test_settled_bed_is_at_rest(bed):
    """Forces balance on every sphere, nothing turns, nothing moves in 0.1 s."""
    before = bed.by_identity(bed.spheres.position)
    weight = bed.spheres.mass[: bed.rows] * G
    unbalanced = bed.spheres.force[: bed.rows] - np.outer(weight, [0.0, 0.0, 1.0])
    assert np.abs(unbalanced).max() < 1e-6 * weight.min()
    assert np.abs(bed.spheres.spin[: bed.rows]).max() < 1e-9
    bed.advance(2500)
    assert np.abs(bed.by_identity(bed.spheres.position) - before).max() < 1e-9


def test_walls_carry_the_weight(settled_bed):
    """Vertical force on all walls = weight within 0.1 %, none sideways; every wall carries a part."""
    weight = settled_bed.spheres.mass.sum() * G
    forces = {name: settled_bed.wall_force(name) for name in settled_bed.wall_names}
    total = np.sum(list(forces.values()), axis=0)
    assert -total[2] == pytest.approx(weight, rel=1e-3)
    assert np.abs(total[:2]).max() < 1e-3 * weight
    assert all(force[2] < 0.0 for force in forces.values())


def test_friction_is_within_the_limit_everywhere(bed, springs, pair_law, wall_law):
    """At rest no contact's spring carries more than mu_s N allows: |S_t xi| <= (1 + c_t) mu_s N."""
    x, r = bed.by_identity(bed.spheres.position), bed.by_identity(bed.spheres.radius)
    m = bed.by_identity(bed.spheres.mass)
    law = pair_law()
    pairs, _ = springs(bed)
    i, j = np.array(list(pairs)).T
    n = x[i] - x[j]
    distance = np.linalg.norm(n, axis=1)
    n /= distance[:, None]
    spring = np.array(list(pairs.values()))
    assert np.abs((spring * n).sum(axis=1)).max() < 1e-6 * np.abs(spring).max()
    radius, mass = r[i] * r[j] / (r[i] + r[j]), m[i] * m[j] / (m[i] + m[j])
    deep = r[i] + r[j] - distance
    s_n, s_t = 2.0 * law.modulus * np.sqrt(radius * deep), 8.0 * law.shear_modulus * np.sqrt(radius * deep)
    beta = np.log(0.7) / np.hypot(np.log(0.7), np.pi)
    dashpot = -2.0 * np.sqrt(5.0 / 6.0) * beta * np.sqrt(np.array([s_n, s_t]) * mass)
    c_n, c_t = np.array([0.5, 1.75])[:, None] * dashpot * 4.0e-5 / mass
    load = 2.0 / 3.0 * s_n * deep / (1.0 + c_n)
    share = s_t * np.linalg.norm(spring, axis=1) / (1.0 + c_t) / (0.5 * load)
    assert share.max() <= 1.0 + 1e-6
    assert share.max() > 0.9  # some are at the limit


def test_energy_only_falls_while_the_bed_settles(simulate, settled_bed):
    """Height, motion and springs together, sampled every 0.01 s, never exceed an earlier sample."""
    x = settled_bed.by_identity(settled_bed.spheres.position) + np.array([0.0, 0.0, 0.01])
    r = settled_bed.by_identity(settled_bed.spheres.radius)
    walls = {"hopper": [[0.012, 0.0], [0.03, 0.018], [0.03, 0.2]], "gate": [[0.0, 0.0], [0.012, 0.0]]}
    sim = simulate(x, r, walls=walls, gravity=G)
    sim.advance(1)
    start = sim.energy()
    least, potential = sum(start), start[1]
    for _ in range(20):
        sim.advance(250)
        energy = sim.energy()
        assert sum(energy) <= least + 0.001 * (potential - energy[1])
        least = min(least, sum(energy))
    assert potential - energy[1] > 0.9 * sim.spheres.mass.sum() * G * 0.01
