"""A few spheres held from all sides, against the plain solver (`validation/plain.py`).

All terms of the force law act here at once and in general directions, so that each sign and factor shows.
"""

import numpy as np
import pytest

from hopperopt.dem.materials import contact_law
from hopperopt.dem.state import CHUNKS
from validation import plain

PARTICLE, WALL = (1.0e7, 0.25), (2.2e7, 0.3)  # shear modulus (Pa), Poisson's ratio
DENSITY = 2285.0  # kg/m3
GRAVITY = np.array([20.0, -30.0, -800.0])  # m/s2


def heap():
    """Eight spheres of three sizes, settled in a cup around a post with an edge. Walls, radii, centres, m."""
    walls = {
        "cup": np.array([[0.0, 0.0], [2.0, 0.0], [3.2, 1.1], [4.2, 2.25], [4.2, 30.0]]) / 1000,
        "post": np.array([[1.3, 0.2], [1.1, 1.2], [0.0, 1.2]]) / 1000,
    }
    centres = np.array([
        [2.059, -0.157, 1.393], [-1.578, 1.527, 2.21], [0.302, -2.115, 2.891], [0.731, 1.93, 1.381],
        [-2.644, -0.618, 3.987], [2.214, 0.028, 5.634], [0.753, 2.598, 3.771], [-1.727, -2.699, 5.013],
    ]) / 1000  # fmt: skip
    return walls, np.array([1.0, 1.5, 2.0, 1.0, 1.5, 2.0, 1.5, 1.0]) / 1000, centres


def column():
    """300 spheres winding up a tube: so many that the solver adds up its contacts in chunks."""
    count, radius, deep, turn, tube = 300, 0.0015, 1.5e-5, 2.6, 0.0025
    out, angle = tube - radius + deep, turn * np.arange(count)
    rise = np.sqrt((2.0 * radius - deep) ** 2 - (2.0 * out * np.sin(turn / 2.0)) ** 2)
    height = radius - deep + rise * np.arange(count)
    centres = np.column_stack([out * np.cos(angle), out * np.sin(angle), height])
    return {"tube": np.array([[0.0, 0.0], [tube, 0.0], [tube, 1.0]])}, np.full(count, radius), centres


@pytest.mark.parametrize(
    ("arrange", "steps", "rolling", "time_step", "restitution", "friction"),
    [
        (heap, 20, "edem", 4.0e-5, 0.3, 0.5),
        (heap, 20, "cdt", 2.0e-5, 0.9, 0.3),
        (heap, 20, "none", 2.0e-5, 0.0, 3.0),
        (column, 4, "edem", 4.0e-5, 0.7, 0.5),
    ],
)
def test_spheres_move_as_in_the_plain_solver(
    simulate, arrange, steps, rolling, time_step, restitution, friction
):
    """Motion, spins and the forces on the walls; contacts stick and slide, begin and end."""
    walls, radius, centres = arrange()
    rng = np.random.default_rng(4)
    velocity, spin = rng.normal(0.0, 0.3, centres.shape), rng.normal(0.0, 80.0, centres.shape)
    between = PARTICLE, PARTICLE, restitution, friction, 0.05
    at_walls = PARTICLE, WALL, 0.8 * restitution, 0.9 * friction, 0.25
    sim = simulate(
        centres, radius, velocity, walls=walls, pair=contact_law(*between), wall=contact_law(*at_walls),
        time_step=time_step, density=DENSITY, gravity=GRAVITY, rolling=rolling, spin=spin,
    )  # fmt: skip
    other = plain.Plain(
        centres, velocity, spin, radius, DENSITY, walls, plain.law(*between), plain.law(*at_walls),
        time_step, GRAVITY, rolling,
    )  # fmt: skip
    contacts, slid = set(), []
    for _ in range(steps):
        sim.advance(1)
        other.step()
        on_walls = np.array([sim.wall_force(name) for name in walls])
        expected = np.array([other.wall_force[name] for name in walls])
        assert on_walls == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
        contacts.add(str((other.touching, other.touching_wall)))
        slid.append(np.mean(other.sliding))
    moved = sim.by_identity(sim.spheres.position) - centres
    assert moved == pytest.approx(other.x - centres, abs=1e-9 * np.abs(moved).max())
    for obtained, expected in ((sim.spheres.velocity, other.v), (sim.spheres.spin, other.omega)):
        assert sim.by_identity(obtained) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert len(contacts) > 2 and 0.1 < np.mean(slid) < 0.95
    assert arrange is heap or sim.counters[CHUNKS] > 1
