"""What a simulation stores: spheres, the two contact lists, the laws and the counters.

Arrays per quantity, SI units, rows in the spheres' current order. `identity[row]` is the number under
which a sphere was created; rows move when the spheres are re-sorted, identities never do.
"""

from typing import NamedTuple

import numpy as np


class Spheres(NamedTuple):
    """State of the spheres, one row each; the first `counters[COUNT]` rows are in the simulation.

    What a contact reads of a sphere lies together: its place in half a cache line, its motion in one.
    """

    place: np.ndarray  # (n, 4) position (m), RADIUS (m)
    motion: np.ndarray  # (n, 8) velocity (m/s), PER_MASS (1/kg), SPIN (rad/s), PER_INERTIA (1/(kg m2))
    mass: np.ndarray  # (n,) kg
    identity: np.ndarray  # (n,) uint32
    sums: np.ndarray  # (5/3 n, 8) of the contacts in the last step: force (N), ROLLING_LIMIT, TORQUE (N m)
    anchor: np.ndarray  # (n, 4) position when the lists were built (m), SKIN (m): how far it may move from it

    @property
    def position(self):
        """(n, 3) m"""
        return self.place[:, :3]

    @property
    def radius(self):
        """(n,) m"""
        return self.place[:, RADIUS]

    @property
    def velocity(self):
        """(n, 3) m/s, half a step behind the position"""
        return self.motion[:, :3]

    @property
    def spin(self):
        """(n, 3) rad/s, half a step behind"""
        return self.motion[:, SPIN : SPIN + 3]

    @property
    def force(self):
        """(n, 3) N, of the contacts in the last step"""
        return self.sums[: len(self.mass), :3]


# Columns of `place`, `motion`, `sums` and `anchor` after the first three. They are unsigned, like all that
# indexes the inner loops: numba checks signed indices for negative ones.
RADIUS = SKIN = np.uint64(3)
PER_MASS, SPIN, PER_INERTIA = np.uint64(3), np.uint64(4), np.uint64(7)
ROLLING_LIMIT, TORQUE = np.uint64(3), np.uint64(4)  # the limit: N m, of the rolling torques of all contacts
PLACE, MOTION, SUMS = np.uint64(4), np.uint64(8), np.uint64(8)  # length of a row
VECTOR, ONE, TWO = np.uint64(3), np.uint64(1), np.uint64(2)


class Pairs(NamedTuple):
    """Half list of neighbours: row i holds `partner[start[i]:start[i + 1]]`, all of them > i."""

    start: np.ndarray  # (n + 1,) uint32; unsigned rows need no check for negative ones in the inner loops
    partner: np.ndarray  # (capacity,) uint32
    owner: np.ndarray  # (capacity,) uint32, the row i of each entry
    touched: np.ndarray  # (capacity,) int64, the step in which the pair was last in contact
    spring: np.ndarray  # (capacity, 3) m, tangential spring of i against its partner, valid if it touched
    contact: np.ndarray  # (capacity,) uint32, scratch: the entries in contact in this step
    carried: np.ndarray  # (capacity, 2) uint32, identities of the contacts that a rebuild carries over
    carried_spring: np.ndarray  # (capacity, 3) m


class Touches(NamedTuple):
    """Spheres near walls: row i holds the surfaces `surface[start[i]:start[i + 1]]`."""

    start: np.ndarray  # (n + 1,) uint32
    owner: np.ndarray  # (capacity,) uint32, the row i of each entry
    surface: np.ndarray  # (capacity,) int32
    first: np.ndarray  # (capacity,) int32, range of the surface's elements that are within reach
    last: np.ndarray  # (capacity,) int32, inclusive
    element: np.ndarray  # (capacity,) int32, element in contact in the last step, -1 for none
    spring: np.ndarray  # (capacity, 3) m
    carried: np.ndarray  # (capacity, 3) int64: identity, surface, element
    carried_spring: np.ndarray  # (capacity, 3) m


class Chunks(NamedTuple):
    """Rows in consecutive chunks that are worked on independently, each with what it needs for itself.

    A pair belongs to the chunk of its row i. Forces on a partner in a later chunk are summed in a window of
    their own behind the rows of `sums`, and added in the order of the chunks: the sums are the same bits for
    any number of threads.
    """

    first: np.ndarray  # (MOST_CHUNKS + 1,) int64, first row of each chunk
    reach: np.ndarray  # (MOST_CHUNKS,) int64, one past the last row that its pairs push, at least its own end
    window: np.ndarray  # (MOST_CHUNKS,) int64, row of `sums` that holds its forces on the first row after it
    block: np.ndarray  # (MOST_CHUNKS, size) buffers of `contacts`
    seen: np.ndarray  # (MOST_CHUNKS, 3) what its spheres did in the last step: FASTEST, BEYOND, MOVED
    wall_force: np.ndarray  # (MOST_CHUNKS, profiles, 3) N, of its spheres on each wall in the last step


MOST_CHUNKS = 64
FASTEST, BEYOND, MOVED = range(3)


class Law(NamedTuple):
    """Constants of the contact law between two materials (see `laws`)."""

    modulus: float  # E*, Pa
    shear_modulus: float  # G*, Pa
    damping: float  # 2 sqrt(5/6) beta
    friction: float  # mu_s
    rolling: float  # mu_r


class Laws(NamedTuple):
    """The laws of a run."""

    pair: Law
    wall: Law


class Settings(NamedTuple):
    """What stays constant during a call of `step.advance`."""

    time_step: float  # s
    gravity: np.ndarray  # (3,) m/s2
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
COUNT, STEP, OPENED, STALE, REBUILDS, CHUNKS, PAIR_CARRIED, TOUCH_CARRIED, NEEDED = COUNTERS = range(9)
# Float monitors: largest overlap over the smaller radius, largest squared ratio of a speed to the fall speed.
OVERLAP, SPEED = range(2)

NEVER = -2  # step of a contact that has not been; -1 is the step before the first
CACHE_LINE = 64  # bytes
PARKED = -1.0e6  # m: where a sphere that left waits for the next rebuild to drop it


def make_spheres(position, velocity, radius, density, spin=None):
    """Spheres at rest in the lists' sense: nothing built yet.

    Arguments: `position`, `velocity`, `spin` (n, 3) in m, m/s, rad/s; `radius` (n,) in m; `density` kg/m3.
    """
    radius = np.array(radius, dtype=np.float64)
    n = len(radius)
    mass = density * 4.0 / 3.0 * np.pi * radius**3
    spheres = Spheres(
        place=aligned(n, 4),
        motion=aligned(n, 8),
        mass=mass,
        identity=np.arange(n, dtype=np.uint32),
        sums=aligned(n + 2 * n // 3 + 1, 8),
        anchor=aligned(n, 4),
    )
    spheres.position[:] = np.reshape(position, (n, 3))
    spheres.radius[:] = radius
    spheres.velocity[:] = np.reshape(velocity, (n, 3))
    spheres.spin[:] = 0.0 if spin is None else np.reshape(spin, (n, 3))
    spheres.motion[:, PER_MASS] = 1.0 / mass
    spheres.motion[:, PER_INERTIA] = 1.0 / (0.4 * mass * radius**2)
    return spheres


def aligned(rows, columns):
    """Zeros whose rows do not straddle more cache lines than they must."""
    room = np.zeros(rows * columns + CACHE_LINE // 8)
    skip = -room.ctypes.data % CACHE_LINE // 8
    return room[skip : skip + rows * columns].reshape(rows, columns)


def make_pairs(count, capacity):
    """Empty neighbour list for `count` spheres and at most `capacity` entries."""
    return Pairs(
        start=np.zeros(count + 1, np.uint32),
        partner=np.zeros(capacity, np.uint32),
        owner=np.zeros(capacity, np.uint32),
        touched=np.full(capacity, NEVER, np.int64),
        spring=np.zeros((capacity, 3)),
        contact=np.zeros(capacity, np.uint32),
        carried=np.zeros((capacity, 2), np.uint32),
        carried_spring=np.zeros((capacity, 3)),
    )


def make_touches(count, capacity):
    """Empty wall list for `count` spheres and at most `capacity` entries."""
    return Touches(
        start=np.zeros(count + 1, np.uint32),
        owner=np.zeros(capacity, np.uint32),
        surface=np.zeros(capacity, np.int32),
        first=np.zeros(capacity, np.int32),
        last=np.zeros(capacity, np.int32),
        element=np.full(capacity, -1, np.int32),
        spring=np.zeros((capacity, 3)),
        carried=np.zeros((capacity, 3), np.int64),
        carried_spring=np.zeros((capacity, 3)),
    )


def make_chunks(profiles, block):
    """No chunks yet, for `profiles` walls and a buffer of `block` numbers each."""
    return Chunks(
        first=np.zeros(MOST_CHUNKS + 1, np.int64),
        reach=np.zeros(MOST_CHUNKS, np.int64),
        window=np.zeros(MOST_CHUNKS, np.int64),
        block=np.zeros((MOST_CHUNKS, block)),
        seen=np.zeros((MOST_CHUNKS, 3)),
        wall_force=np.zeros((MOST_CHUNKS, profiles, 3)),
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
