"""A small bed in which everything happens at once, for the cases that look at whole steps; and its springs.

240 spheres of three sizes, poured into a hopper with a knee and a gate over an insert with smooth and sharp
edges, under a tilted weight of 15 g; then stirred, spun, and the upper ones thrown into the air. The poured
positions are kept in bed.csv, rounded, so that the cases start from the same ones on every machine and with
every version of the solver; `python -m validation.bed` pours anew.
"""

from pathlib import Path

import numpy as np

from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import Simulation
from validation.setups import DENSITY, PARTICLE, PLEXIGLASS, TIME_STEP

POURED = Path(__file__).with_suffix(".csv")
COUNT = 240
PAIR, WALL = (0.7, 0.5, 0.05), (0.2, 0.5, 0.25)  # restitution, friction, rolling friction
GRAVITY = np.array([15.0, -10.0, -150.0])  # m/s2
WALLS = {
    "hopper": np.array([[6.0, 0.0], [8.4, 2.0], [10.4, 4.0], [12.2, 6.1], [14.0, 8.7], [14.0, 120.0]]) / 1000,
    "insert": np.array([[0.0, 8.0], [4.0, 8.0], [4.0, 10.0], [3.6, 12.0], [2.8, 14.0], [0.0, 17.0]]) / 1000,
    "gate": np.array([[0.0, 0.0], [6.0, 0.0]]) / 1000,
}


def simulation(
    position, velocity, spin, radius, gravity=GRAVITY, walls=WALLS, rolling="edem", time_step=TIME_STEP
):
    """A simulation with the study's materials, and at its step unless told otherwise; SI units."""
    pair, wall = contact_law(PARTICLE, PARTICLE, *PAIR), contact_law(PARTICLE, PLEXIGLASS, *WALL)
    return Simulation(
        position, velocity, radius, DENSITY, walls, pair, wall, time_step, gravity, rolling, spin
    )


def stirred():
    """Positions, velocities, spins (n, 3) and radii (n,) of the poured bed, set in motion; SI units."""
    x, y, z, diameter = np.loadtxt(POURED, delimiter=",", skiprows=1, unpack=True) / 1000
    position = np.column_stack([x, y, z])
    rng = np.random.default_rng(12)
    velocity = np.cross([0.0, 40.0, 40.0], position - position.mean(axis=0))
    velocity += rng.normal(0.0, 0.05, position.shape)
    velocity[z > np.quantile(z, 0.9), 2] += 2.0
    return position, velocity, rng.normal(0.0, 60.0, position.shape), diameter / 2


def springs(sim):
    """Tangential springs (m) after the last step, by what they join.

    Returns {(i, j): (3,)}, of i against j, i < j; and {(i, wall): (k, 3)}, of i against that wall's surfaces
    in the order of their elements. Only what is in contact has one.
    """
    ids, pairs, touches = sim.spheres.identity, sim.pairs, sim.touches
    owner = np.repeat(np.arange(sim.rows), np.diff(pairs.start[: sim.rows + 1]))
    listed = sim.touching()
    one, other = ids[owner[listed]], ids[pairs.partner[listed]]
    turned = np.where(one < other, 1.0, -1.0)[:, None] * pairs.spring[listed]
    names = zip(np.minimum(one, other).tolist(), np.maximum(one, other).tolist(), strict=True)
    owner = np.repeat(np.arange(sim.rows), np.diff(touches.start[: sim.rows + 1]))
    held = np.flatnonzero(touches.element[: len(owner)] >= 0)
    at_walls = {}
    for k in held[np.argsort(touches.element[held], kind="stable")]:
        place = int(ids[owner[k]]), sim.wall_names[sim.walls.profile[touches.element[k]]]
        at_walls.setdefault(place, []).append(touches.spring[k].copy())
    return dict(zip(names, turned, strict=True)), {at: np.array(held) for at, held in at_walls.items()}


def pour():
    """Pour the bed and keep it: millimetres to 0.1 um."""
    rng = np.random.default_rng(7)
    steps = np.arange(-2, 3) * 0.0043
    layer = np.array([(x, y) for x in steps for y in steps if np.hypot(x, y) < 0.0115])
    places = [(x, y, 0.02 + 0.0043 * k) for k in range(-(-COUNT // len(layer))) for x, y in layer]
    radius = rng.permutation(np.repeat([0.001, 0.0015, 0.002], COUNT // 3))
    velocity = rng.normal(0.0, 0.1, (COUNT, 3)) - [0.0, 0.0, 0.5]
    sim = simulation(places[:COUNT], velocity, np.zeros_like(velocity), radius)
    sim.advance(3000)
    table = np.column_stack([sim.by_identity(sim.spheres.position), 2 * radius]) * 1000
    np.savetxt(POURED, table, "%.4f", ",", header="x_mm,y_mm,z_mm,diameter_mm", comments="")


if __name__ == "__main__":
    pour()
