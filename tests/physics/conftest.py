"""Shared set-ups of the physics tests: the study's materials, spheres among walls, and a settled bed.

Fixtures hand out functions, so that a test reads as its own experiment.
"""

import copy

import numpy as np
import pytest

from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import Simulation

PARTICLE = (1.0e7, 0.25)  # shear modulus (Pa), Poisson's ratio
PLEXIGLASS = (2.2e7, 0.25)


@pytest.fixture(scope="session")
def pair_law():
    """Law between two particles of the study, with what a test wants different."""

    def make(restitution=0.7, friction=0.5, rolling=0.05, material=PARTICLE):
        return contact_law(material, material, restitution, friction, rolling)

    return make


@pytest.fixture(scope="session")
def wall_law():
    """Law between a particle and a wall of the study, with what a test wants different."""

    def make(restitution=0.2, friction=0.5, rolling=0.25, particle=PARTICLE, wall=PLEXIGLASS):
        return contact_law(particle, wall, restitution, friction, rolling)

    return make


@pytest.fixture(scope="session")
def simulate(pair_law, wall_law):
    """A simulation of spheres at rest without walls in weightlessness, unless told otherwise."""

    def make(
        position,
        radius,
        velocity=None,
        *,
        walls=None,
        pair=None,
        wall=None,
        time_step=4.0e-5,
        density=2285.0,
        gravity=0.0,
        **options,
    ):
        position = np.atleast_2d(np.asarray(position, dtype=float))
        velocity = np.zeros_like(position) if velocity is None else velocity
        radius = np.broadcast_to(radius, len(position))
        return Simulation(
            position,
            velocity,
            radius,
            density,
            walls or {},
            pair or pair_law(),
            wall or wall_law(),
            time_step,
            gravity,
            **options,
        )

    return make


@pytest.fixture(scope="session")
def hertz():
    """Hertz's closed forms for an impact or a static contact of effective radius, mass and modulus."""

    class Hertz:
        @staticmethod
        def force(overlap, radius, modulus):
            return 4.0 / 3.0 * modulus * np.sqrt(radius) * overlap**1.5

        @staticmethod
        def overlap(force, radius, modulus):
            return (0.75 * force / (modulus * np.sqrt(radius))) ** (2.0 / 3.0)

        @staticmethod
        def deepest(speed, radius, mass, modulus):
            return (15.0 / 16.0 * mass * speed**2 / (modulus * np.sqrt(radius))) ** 0.4

        @staticmethod
        def duration(speed, radius, mass, modulus):
            return 2.9432 * Hertz.deepest(speed, radius, mass, modulus) / speed

    return Hertz


def _springs(sim):
    """Tangential springs (m) by what they join: {(i, j): of i against j, i < j}, {(i, wall): of i}."""
    ids, pairs, touches = sim.spheres.identity, sim.pairs, sim.touches
    ends = pairs.start[: sim.rows + 1]
    owner = np.repeat(np.arange(sim.rows), np.diff(ends))
    listed = sim.touching()
    one, other = ids[owner[listed]], ids[pairs.partner[listed]]
    springs = np.where(one < other, 1.0, -1.0)[:, None] * pairs.spring[listed]
    names = zip(np.minimum(one, other).tolist(), np.maximum(one, other).tolist(), strict=True)
    ends = touches.start[: sim.rows + 1]
    owner = np.repeat(np.arange(sim.rows), np.diff(ends))
    listed = np.flatnonzero(touches.element[: ends[-1]] >= 0)
    walls = [sim.wall_names[w] for w in sim.walls.profile[touches.element[listed]]]
    places = zip(ids[owner[listed]].tolist(), walls, strict=True)
    return (
        dict(zip(names, springs, strict=True)),
        dict(zip(places, touches.spring[listed].copy(), strict=True)),
    )


@pytest.fixture(scope="session")
def springs():
    """A function that reads the contacts of the last step and their springs: the one look into the lists."""
    return _springs


BED_WALLS = {
    "hopper": [[0.012, 0.0], [0.03, 0.018], [0.03, 0.2]],
    "gate": [[0.0, 0.0], [0.012, 0.0]],
    "insert": [[0.0, 0.016], [0.008, 0.016], [0.0, 0.026]],
}


@pytest.fixture(scope="session")
def settled_bed(simulate):
    """1,200 spheres of three sizes, poured into a small hopper with an insert and settled at 4e-5 s."""
    rng = np.random.default_rng(7)
    steps = np.arange(-6, 7) * 0.0043
    layer = np.array([(x, y) for x in steps for y in steps if np.hypot(x, y) < 0.0275])
    count = 1200
    layers = -(-count // len(layer))
    position = np.array([(x, y, 0.032 + 0.0043 * k) for k in range(layers) for x, y in layer])[:count]
    radius = rng.permutation(np.repeat([0.001, 0.0015, 0.002], count // 3))
    velocity = rng.normal(0.0, 0.1, (count, 3)) - [0.0, 0.0, 0.5]
    sim = simulate(position, radius, velocity, walls=BED_WALLS, gravity=9.81)
    sim.advance(15_000)
    return sim


@pytest.fixture
def bed(settled_bed):
    """The settled bed, a test's own."""
    return copy.deepcopy(settled_bed)
