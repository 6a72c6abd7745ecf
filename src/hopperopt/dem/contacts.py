"""Forces of all contacts, in blocks: gather, one vector loop over the law, scatter.

A block is one flat buffer of rows (quantities) by lanes (contacts), indexed `row * STRIDE + lane`: one array
needs no alias checks, so the compiler turns the law's loop into vector instructions. Pairs and walls differ
only in how they fill the rows and where they add the result.
"""

import math

import numpy as np
from numba import njit

from hopperopt.dem.laws import FAST, directional_torque, hertz_mindlin
from hopperopt.dem.state import (
    MOTION,
    OVERLAP,
    PER_MASS,
    PLACE,
    RADIUS,
    ROLLING_CDT,
    ROLLING_EDEM,
    ROLLING_LIMIT,
    SPIN,
    STEP,
    SUMS,
    TORQUE,
    VECTOR,
)
from hopperopt.dem.walls import nearest

LANES = np.uint64(64)
STRIDE = LANES + np.uint64(8)  # no power of two: rows would share cache sets


def _rows(first, number):
    return (np.uint64(row) * STRIDE for row in range(first, first + number))


# Where the rows of a block begin. Filled by the gatherers:
NX, NY, NZ = _rows(0, 3)  # unit normal towards the sphere i
VX, VY, VZ = _rows(3, 3)  # velocity of i's surface relative to the other's (m/s)
XI_X, XI_Y, XI_Z = _rows(6, 3)  # tangential spring (m), old and then new
DELTA, R, M, PER_M = _rows(9, 4)  # overlap; effective radius, mass and its reciprocal
(SMALLER,) = _rows(13, 1)  # the smaller radius (m)
ARM_I, ARM_J = _rows(14, 2)  # lever arms l_i, l_j (m)
# Filled by the law:
FX, FY, FZ = _rows(16, 3)  # force on i (N)
TX, TY, TZ = _rows(19, 3)  # n x -F_t; times the lever arm: torque on either body (N)
RX, RY, RZ = _rows(22, 3)  # rolling torque on i, opposite on j, for `cdt` (N m)
LOAD, WORST, WORST_SMALLER = _rows(25, 3)  # elastic load (N); the deepest overlap so far and its SMALLER
# Scratch of the pair gatherer:
IX, IY, IZ = _rows(28, 3)  # spin of i
JX, JY, JZ = _rows(31, 3)  # spin of j
RADIUS_I, RADIUS_J = _rows(34, 2)
BLOCK = int(np.uint64(36) * STRIDE)


@njit(**FAST)
def apply_law(block, lanes, law, dt):
    """Forces of `lanes` contacts from the gathered rows: the law of `laws.hertz_mindlin`, lane by lane."""
    for q in range(lanes):
        n = (block[NX + q], block[NY + q], block[NZ + q])
        v = (block[VX + q], block[VY + q], block[VZ + q])
        xi = (block[XI_X + q], block[XI_Y + q], block[XI_Z + q])
        delta = block[DELTA + q]
        normal, load, f, xi = hertz_mindlin(
            delta, n, v, xi,
            block[R + q], block[M + q], block[PER_M + q], law, dt,
        )  # fmt: skip
        block[XI_X + q] = xi[0]
        block[XI_Y + q] = xi[1]
        block[XI_Z + q] = xi[2]
        block[FX + q] = normal * n[0] + f[0]
        block[FY + q] = normal * n[1] + f[1]
        block[FZ + q] = normal * n[2] + f[2]
        block[TX + q] = n[2] * f[1] - n[1] * f[2]
        block[TY + q] = n[0] * f[2] - n[2] * f[0]
        block[TZ + q] = n[1] * f[0] - n[0] * f[1]
        block[LOAD + q] = load
        smaller = block[SMALLER + q]
        worst, worst_smaller = block[WORST + q], block[WORST_SMALLER + q]
        deeper = delta * worst_smaller > worst * smaller
        block[WORST + q] = delta if deeper else worst
        block[WORST_SMALLER + q] = smaller if deeper else worst_smaller


@njit(**FAST)
def roll_cdt(block, lanes, law, arm):
    """Rolling torques of the `cdt` model; `arm`: row of the lever arm, R* of pairs, l_i at walls."""
    for q in range(lanes):
        n = (block[NX + q], block[NY + q], block[NZ + q])
        w = (
            block[IX + q] - block[JX + q],
            block[IY + q] - block[JY + q],
            block[IZ + q] - block[JZ + q],
        )
        t = directional_torque(n, w, law.rolling * block[LOAD + q] * block[arm + q])
        block[RX + q] = t[0]
        block[RY + q] = t[1]
        block[RZ + q] = t[2]


@njit(**FAST)
def clear_overlaps(block):
    """Forget the deepest contacts of a block."""
    for q in range(LANES):
        block[WORST + q], block[WORST_SMALLER + q] = 0.0, 1.0


@njit(**FAST)
def note_overlaps(block, monitors):
    """Move the largest overlap ratio of a block into the monitors."""
    for q in range(LANES):
        if block[WORST + q] > 0.0:
            ratio = block[WORST + q] / block[WORST_SMALLER + q]
            monitors[OVERLAP] = max(monitors[OVERLAP], ratio)


@njit(**FAST)
def find_contacts(place, pairs, begin, end):
    """List those of the entries `begin ... end` that touch, in `pairs.contact` from `begin` on. Returns their
    end. `place` is flat."""
    contact, owner, partner = pairs.contact, pairs.owner, pairs.partner
    found = begin
    for k in range(begin, end):
        i, j = PLACE * np.uint64(owner[k]), PLACE * np.uint64(partner[k])
        squared = 0.0
        for a in range(VECTOR):
            squared += (place[i + a] - place[j + a]) ** 2
        reach = place[i + RADIUS] + place[j + RADIUS]
        # Written first, kept by moving on: no branch to mispredict.
        contact[found] = k
        found += np.uint64(squared < reach * reach)
    return found


@njit(**FAST)
def gather_pairs(place, motion, pairs, spring, block, begin, lanes, step):
    """Copy the states of the contacts `begin ... begin + lanes` into the block. All arrays are flat.

    A pair that was apart in the step before starts with a slack spring.
    """
    contact, owner, partner, touched = pairs.contact, pairs.owner, pairs.partner, pairs.touched
    for q in range(lanes):
        k = np.uint64(contact[begin + q])
        i, j = np.uint64(owner[k]), np.uint64(partner[k])
        held = 1.0 if touched[k] == step - 1 else 0.0
        touched[k] = step
        here, there = PLACE * i, PLACE * j
        for a in range(VECTOR):
            block[NX + a * STRIDE + q] = place[here + a] - place[there + a]
        block[RADIUS_I + q] = place[here + RADIUS]
        block[RADIUS_J + q] = place[there + RADIUS]
        here, there = MOTION * i, MOTION * j
        for a in range(VECTOR):
            block[VX + a * STRIDE + q] = motion[here + a] - motion[there + a]
            block[IX + a * STRIDE + q] = motion[here + SPIN + a]
            block[JX + a * STRIDE + q] = motion[there + SPIN + a]
            block[XI_X + a * STRIDE + q] = held * spring[VECTOR * k + a]
        block[PER_M + q] = motion[here + PER_MASS] + motion[there + PER_MASS]


@njit(**FAST)
def meet_pairs(block, lanes):
    """Geometry and relative surface velocity of gathered pairs.

    l = R - delta/2 on both sides, v = v_i - v_j - (l_i omega_i + l_j omega_j) x n: a free cluster keeps its
    linear and angular momentum.
    """
    for q in range(lanes):
        dx, dy, dz = block[NX + q], block[NY + q], block[NZ + q]
        r_i, r_j, per_mass = block[RADIUS_I + q], block[RADIUS_J + q], block[PER_M + q]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        inverse = 1.0 / distance
        delta = r_i + r_j - distance
        nx, ny, nz = dx * inverse, dy * inverse, dz * inverse
        l_i, l_j = r_i - 0.5 * delta, r_j - 0.5 * delta
        sx = l_i * block[IX + q] + l_j * block[JX + q]
        sy = l_i * block[IY + q] + l_j * block[JY + q]
        sz = l_i * block[IZ + q] + l_j * block[JZ + q]
        block[DELTA + q] = delta
        block[NX + q] = nx
        block[NY + q] = ny
        block[NZ + q] = nz
        block[VX + q] -= sy * nz - sz * ny
        block[VY + q] -= sz * nx - sx * nz
        block[VZ + q] -= sx * ny - sy * nx
        both = 1.0 / ((r_i + r_j) * per_mass)  # one division for R* and m*
        block[R + q] = r_i * r_j * per_mass * both
        block[M + q] = (r_i + r_j) * both
        block[SMALLER + q] = min(r_i, r_j)
        block[ARM_I + q] = l_i
        block[ARM_J + q] = l_j


@njit(**FAST)
def scatter_pairs(sums, pairs, spring, block, begin, lanes, end, window, rolling, friction):
    """Add the block's forces and torques to both spheres of each contact; keep the springs. Arrays are flat.

    A partner beyond the chunk's `end` has its sums in the chunk's `window`.
    """
    contact, owner, partner = pairs.contact, pairs.owner, pairs.partner
    for q in range(lanes):
        k = np.uint64(contact[begin + q])
        i, j = np.uint64(owner[k]), np.uint64(partner[k])
        here, there = SUMS * i, SUMS * (j if j < end else j - end + window)
        l_i, l_j = block[ARM_I + q], block[ARM_J + q]
        for a in range(VECTOR):
            f, t = block[FX + a * STRIDE + q], block[TX + a * STRIDE + q]
            spring[VECTOR * k + a] = block[XI_X + a * STRIDE + q]
            sums[here + a] += f
            sums[there + a] -= f
            sums[here + TORQUE + a] += l_i * t
            sums[there + TORQUE + a] += l_j * t
        if rolling == ROLLING_EDEM:
            limit = friction * block[LOAD + q]
            sums[here + ROLLING_LIMIT] += limit * l_i
            sums[there + ROLLING_LIMIT] += limit * l_j
        elif rolling == ROLLING_CDT:
            for a in range(VECTOR):
                sums[here + TORQUE + a] += block[RX + a * STRIDE + q]
                sums[there + TORQUE + a] -= block[RX + a * STRIDE + q]


@njit(**FAST)
def pair_forces(c, spheres, pairs, chunks, counters, law, settings):
    """Add the forces of chunk c's pairs in touch. Returns the number of contacts."""
    block = chunks.block[c]
    place, motion, sums = spheres.place.ravel(), spheres.motion.ravel(), spheres.sums.ravel()
    spring = pairs.spring.ravel()
    end, window = np.uint64(chunks.first[c + 1]), np.uint64(chunks.window[c])
    begin = np.uint64(pairs.start[chunks.first[c]])
    last = find_contacts(place, pairs, begin, np.uint64(pairs.start[end]))
    contacts = last - begin
    while begin < last:
        lanes = min(LANES, last - begin)
        gather_pairs(place, motion, pairs, spring, block, begin, lanes, counters[STEP])
        meet_pairs(block, lanes)
        apply_law(block, lanes, law, settings.time_step)
        if settings.rolling == ROLLING_CDT:
            roll_cdt(block, lanes, law, R)
        scatter_pairs(sums, pairs, spring, block, begin, lanes, end, window, settings.rolling, law.rolling)
        begin += lanes
    return contacts


@njit(**FAST)
def deepest(walls, first, last, r, z, radius):
    """Which of the elements first ... last of a surface a sphere overlaps most.

    Arguments: centre in its meridian plane and radius of the sphere, m. Returns (element or -1, overlap in m,
    normal towards the sphere: components r, z).
    """
    found, shortest, n_r, n_z = -1, radius * radius, 0.0, 0.0
    for e in range(first, last + 1):
        if walls.closed[e]:
            dr, dz, closest = nearest(walls, e, r, z)
            squared = dr * dr + dz * dz
            if closest and 0.0 < squared < shortest:
                found, shortest, n_r, n_z = e, squared, dr, dz
    distance = math.sqrt(shortest)
    inverse = 1.0 / distance
    return found, radius - distance, n_r * inverse, n_z * inverse


@njit(**FAST)
def gather_touch(spheres, touches, block, q, i, k, r, delta, n_r, n_z):
    """Fill lane q with sphere i, r from the axis, against the wall of entry k: l_i = R_i - delta, a wall at
    rest."""
    outwards = n_r / r if r > 0.0 else 0.0
    # On the axis the meridian plane is arbitrary.
    n = (outwards * spheres.place[i, 0] if r > 0.0 else n_r, outwards * spheres.place[i, 1], n_z)
    motion, spring = spheres.motion, touches.spring
    w = (motion[i, SPIN], motion[i, SPIN + np.uint64(1)], motion[i, SPIN + np.uint64(2)])
    arm = spheres.place[i, RADIUS] - delta
    block[DELTA + q] = delta
    block[NX + q], block[NY + q], block[NZ + q] = n
    block[VX + q] = motion[i, 0] - arm * (w[1] * n[2] - w[2] * n[1])
    block[VY + q] = motion[i, 1] - arm * (w[2] * n[0] - w[0] * n[2])
    block[VZ + q] = motion[i, 2] - arm * (w[0] * n[1] - w[1] * n[0])
    block[IX + q], block[IY + q], block[IZ + q] = w
    block[JX + q] = block[JY + q] = block[JZ + q] = 0.0
    block[XI_X + q], block[XI_Y + q], block[XI_Z + q] = spring[k, 0], spring[k, 1], spring[k, 2]
    block[R + q] = block[SMALLER + q] = spheres.place[i, RADIUS]
    block[M + q] = spheres.mass[i]
    block[PER_M + q] = spheres.motion[i, PER_MASS]
    block[ARM_I + q] = arm


@njit(**FAST)
def scatter_touches(spheres, touches, walls, block, wall_force, entries, lanes, rolling, friction):
    """Add the block's forces and torques to the spheres, the reactions to the walls; keep the springs."""
    sums = spheres.sums
    for q in range(lanes):
        k = entries[q]
        i = touches.owner[k]
        wall = walls.profile[touches.element[k]]
        arm = block[ARM_I + q]
        for a in range(VECTOR):
            f = block[FX + a * STRIDE + q]
            touches.spring[k, a] = block[XI_X + a * STRIDE + q]
            sums[i, a] += f
            wall_force[wall, a] -= f
            sums[i, TORQUE + a] += arm * block[TX + a * STRIDE + q]
        if rolling == ROLLING_EDEM:
            sums[i, ROLLING_LIMIT] += friction * block[LOAD + q] * arm
        elif rolling == ROLLING_CDT:
            for a in range(VECTOR):
                sums[i, TORQUE + a] += block[RX + a * STRIDE + q]


@njit(**FAST)
def wall_block(spheres, touches, walls, block, wall_force, entries, lanes, law, settings):
    """The law for `lanes` gathered wall contacts, and its scatter."""
    apply_law(block, lanes, law, settings.time_step)
    if settings.rolling == ROLLING_CDT:
        roll_cdt(block, lanes, law, ARM_I)
    scatter_touches(spheres, touches, walls, block, wall_force, entries, lanes, settings.rolling, law.rolling)


@njit(**FAST)
def wall_forces(c, spheres, touches, walls, chunks, law, settings):
    """Add the forces between the spheres of chunk c and walls. Returns the number of contacts."""
    block, wall_force = chunks.block[c], chunks.wall_force[c]
    wall_force[:] = 0.0
    entries = np.empty(LANES, np.uint32)
    contacts, lanes = 0, np.uint64(0)
    for k in range(touches.start[chunks.first[c]], touches.start[chunks.first[c + 1]]):
        i = touches.owner[k]
        r = math.sqrt(spheres.place[i, 0] ** 2 + spheres.place[i, 1] ** 2)
        element, delta, n_r, n_z = deepest(
            walls, touches.first[k], touches.last[k], r, spheres.place[i, 2], spheres.place[i, RADIUS]
        )
        if element < 0 and touches.element[k] >= 0:
            touches.spring[k, 0] = touches.spring[k, 1] = touches.spring[k, 2] = 0.0
        touches.element[k] = element
        if element < 0:
            continue
        gather_touch(spheres, touches, block, lanes, i, k, r, delta, n_r, n_z)
        entries[lanes] = k
        lanes += np.uint64(1)
        contacts += 1
        if lanes == LANES:
            wall_block(spheres, touches, walls, block, wall_force, entries, lanes, law, settings)
            lanes = np.uint64(0)
    wall_block(spheres, touches, walls, block, wall_force, entries, lanes, law, settings)
    return contacts
