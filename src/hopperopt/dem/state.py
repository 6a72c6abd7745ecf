"""What a simulation stores: spheres, the two contact lists, the laws and the counters.

Arrays per quantity, SI units, rows in the spheres' current order. `identity[row]` is the number under
which a sphere was created; rows move when the spheres are re-sorted, identities never do.
"""

from typing import NamedTuple

import numpy as np


class Spheres(NamedTuple):
    """State of the spheres, one row each; the first `counters[COUNT]` rows are in the simulation."""

    position: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s, half a step behind the position
    spin: np.ndarray  # (n, 3) rad/s, half a step behind
    radius: np.ndarray  # (n,) m
    mass: np.ndarray  # (n,) kg
    identity: np.ndarray  # (n,) int64
    force: np.ndarray  # (n, 3) N, of the contacts in the last step
    torque: np.ndarray  # (n, 3) N m
    rolling_limit: np.ndarray  # (n,) N m, sum of the rolling friction torques of the contacts
    reference: np.ndarray  # (n, 3) m, position when the lists were built
    skin: np.ndarray  # (n,) m, how far the sphere may move from it before the lists are stale


class Pairs(NamedTuple):
    """Half list of neighbours: row i holds `partner[start[i]:start[i + 1]]`, all of them > i."""

    start: np.ndarray  # (n + 1,) uint32; unsigned rows need no check for negative ones in the inner loops
    partner: np.ndarray  # (capacity,) uint32
    owner: np.ndarray  # (capacity,) uint32, the row i of each entry
    touched: np.ndarray  # (capacity,) int64, the step in which the pair was last in contact
    spring: np.ndarray  # (capacity, 3) m, tangential spring of i against its partner, valid if it touched
    contact: np.ndarray  # (capacity,) uint32, scratch: the entries in contact in this step
    carried: np.ndarray  # (capacity, 2) int64, identities of the contacts that a rebuild carries over
    carried_spring: np.ndarray  # (capacity, 3) m


class Touches(NamedTuple):
    """Spheres near walls: row i holds the surfaces `surface[start[i]:start[i + 1]]`."""

    start: np.ndarray  # (n + 1,) int64
    surface: np.ndarray  # (capacity,) int32
    first: np.ndarray  # (capacity,) int32, range of the surface's elements that are within reach
    last: np.ndarray  # (capacity,) int32, inclusive
    element: np.ndarray  # (capacity,) int32, element in contact in the last step, -1 for none
    spring: np.ndarray  # (capacity, 3) m
    carried: np.ndarray  # (capacity, 3) int64: identity, surface, element
    carried_spring: np.ndarray  # (capacity, 3) m


class Law(NamedTuple):
    """Constants of the contact law between two materials (see `laws`)."""

    modulus: float  # E*, Pa
    shear_modulus: float  # G*, Pa
    damping: float  # 2 sqrt(5/6) beta
    friction: float  # mu_s
    rolling: float  # mu_r


class Settings(NamedTuple):
    """What stays constant during a call of `step.advance`."""

    time_step: float  # s
    gravity: np.ndarray  # (3,) m/s2
    pair_law: Law
    wall_law: Law
    rolling: int  # one of the ROLLING_ constants
    skin: float  # m, skin of a sphere at rest
    horizon: float  # s, a moving sphere's skin grows by speed times this
    skin_limit: float  # m
    sensor: float  # m, height of the plane where spheres are taken out; -inf: none
    start_speed2: float  # m2/s2, v0^2 of the fastest start, for the speed monitor
    highest: float  # m, the highest start, for the speed monitor


ROLLING_NONE, ROLLING_EDEM, ROLLING_CDT = 0, 1, 2
ROLLING = {"none": ROLLING_NONE, "edem": ROLLING_EDEM, "cdt": ROLLING_CDT}

# Integer counters of a run, in one array that the compiled code updates.
COUNT, STEP, OPENED, STALE, REBUILDS, PAIR_CARRIED, TOUCH_CARRIED, NEEDED = COUNTERS = range(8)
# Float monitors: largest overlap over the smaller radius, largest squared ratio of a speed to the fall speed.
OVERLAP, SPEED = range(2)

NEVER = -2  # step of a contact that has not been; -1 is the step before the first
PARKED = -1.0e6  # m: where a sphere that left waits for the next rebuild to drop it


def make_spheres(position, velocity, radius, density, spin=None):
    """Spheres at rest in the lists' sense: nothing built yet.

    Arguments: `position`, `velocity`, `spin` (n, 3) in m, m/s, rad/s; `radius` (n,) in m; `density` kg/m3.
    """
    radius = np.array(radius, dtype=np.float64)
    n = len(radius)
    zeros = np.zeros
    return Spheres(
        position=np.array(position, dtype=np.float64).reshape(n, 3),
        velocity=np.array(velocity, dtype=np.float64).reshape(n, 3),
        spin=zeros((n, 3)) if spin is None else np.array(spin, dtype=np.float64).reshape(n, 3),
        radius=radius,
        mass=density * 4.0 / 3.0 * np.pi * radius**3,
        identity=np.arange(n, dtype=np.int64),
        force=zeros((n, 3)),
        torque=zeros((n, 3)),
        rolling_limit=zeros(n),
        reference=zeros((n, 3)),
        skin=zeros(n),
    )


def make_pairs(count, capacity):
    """Empty neighbour list for `count` spheres and at most `capacity` entries."""
    return Pairs(
        start=np.zeros(count + 1, np.uint32),
        partner=np.zeros(capacity, np.uint32),
        owner=np.zeros(capacity, np.uint32),
        touched=np.full(capacity, NEVER, np.int64),
        spring=np.zeros((capacity, 3)),
        contact=np.zeros(capacity, np.uint32),
        carried=np.zeros((capacity, 2), np.int64),
        carried_spring=np.zeros((capacity, 3)),
    )


def make_touches(count, capacity):
    """Empty wall list for `count` spheres and at most `capacity` entries."""
    return Touches(
        start=np.zeros(count + 1, np.int64),
        surface=np.zeros(capacity, np.int32),
        first=np.zeros(capacity, np.int32),
        last=np.zeros(capacity, np.int32),
        element=np.full(capacity, -1, np.int32),
        spring=np.zeros((capacity, 3)),
        carried=np.zeros((capacity, 3), np.int64),
        carried_spring=np.zeros((capacity, 3)),
    )


def grown(entries, capacity):
    """A copy of a contact list whose per-entry arrays hold `capacity` entries; what they held is kept."""
    arrays = []
    for name, old in entries._asdict().items():
        if name == "start":
            arrays.append(old)
            continue
        new = np.zeros((capacity, *old.shape[1:]), old.dtype)
        new[: len(old)] = old
        arrays.append(new)
    return type(entries)(*arrays)
