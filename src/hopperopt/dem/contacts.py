"""Forces of all contacts, in blocks: gather, one vector loop over the law, scatter.

A block is one flat buffer of rows (quantities) by lanes (contacts), indexed `row * STRIDE + lane`: one array
needs no alias checks, so the compiler turns the law's loop into vector instructions. Pairs and walls differ
only in how they fill the rows and where they add the result.
"""

import math

import numpy as np
from numba import njit

from hopperopt.dem.laws import directional_torque, hertz_mindlin
from hopperopt.dem.state import COUNT, OVERLAP, ROLLING_CDT, ROLLING_EDEM, STEP
from hopperopt.dem.walls import nearest

LANES = 64
STRIDE = LANES + 8  # no power of two: rows would share cache sets

# Rows of a block. Filled by the gatherers:
DELTA, NX, NY, NZ = 0, 1, 2, 3  # overlap (m), unit normal towards the sphere i
VX, VY, VZ = 4, 5, 6  # velocity of i's surface relative to the other's (m/s)
XI_X, XI_Y, XI_Z = 7, 8, 9  # tangential spring (m), old and then new
RADIUS, MASS, SMALLER = 10, 11, 12  # effective radius and mass, the smaller radius
ARM_I, ARM_J = 13, 14  # lever arms l_i, l_j (m)
# Filled by the law:
FX, FY, FZ = 18, 19, 20  # force on i (N)
TX, TY, TZ = 21, 22, 23  # n x -F_t; times the lever arm: torque on either body (N)
LOAD = 24  # elastic load N (N)
RX, RY, RZ = 25, 26, 27  # rolling torque on i, opposite on j, for `cdt` (N m)
WORST = 28  # largest overlap over the smaller radius seen in the lane
# Scratch of the pair gatherer:
UX, UY, UZ = 29, 30, 31  # l-free parts of the velocity: v_i - v_j
IX, IY, IZ = 32, 33, 34  # spin of i
JX, JY, JZ = 35, 36, 37  # spin of j
RADIUS_I, RADIUS_J, MASS_I, MASS_J = 38, 39, 40, 41
ROWS = 42


@njit(cache=True)
def make_block():
    """A zeroed block buffer."""
    return np.zeros(ROWS * STRIDE)


@njit(cache=True, error_model="numpy")
def apply_law(block, lanes, law, dt):
    """Forces of `lanes` contacts from the gathered rows: the law of `laws.hertz_mindlin`, lane by lane."""
    for q in range(lanes):
        n = (block[NX * STRIDE + q], block[NY * STRIDE + q], block[NZ * STRIDE + q])
        v = (block[VX * STRIDE + q], block[VY * STRIDE + q], block[VZ * STRIDE + q])
        xi = (block[XI_X * STRIDE + q], block[XI_Y * STRIDE + q], block[XI_Z * STRIDE + q])
        delta = block[DELTA * STRIDE + q]
        normal, load, f, xi = hertz_mindlin(
            delta, n, v, xi, block[RADIUS * STRIDE + q], block[MASS * STRIDE + q], law, dt
        )
        block[XI_X * STRIDE + q] = xi[0]
        block[XI_Y * STRIDE + q] = xi[1]
        block[XI_Z * STRIDE + q] = xi[2]
        block[FX * STRIDE + q] = normal * n[0] + f[0]
        block[FY * STRIDE + q] = normal * n[1] + f[1]
        block[FZ * STRIDE + q] = normal * n[2] + f[2]
        block[TX * STRIDE + q] = n[2] * f[1] - n[1] * f[2]
        block[TY * STRIDE + q] = n[0] * f[2] - n[2] * f[0]
        block[TZ * STRIDE + q] = n[1] * f[0] - n[0] * f[1]
        block[LOAD * STRIDE + q] = load
        ratio = delta / block[SMALLER * STRIDE + q]
        worst = block[WORST * STRIDE + q]
        block[WORST * STRIDE + q] = ratio if ratio > worst else worst


@njit(cache=True, error_model="numpy")
def roll_cdt(block, lanes, law, arm):
    """Rolling torques of the `cdt` model; `arm`: row of the lever arm, R* of pairs, l_i at walls."""
    for q in range(lanes):
        n = (block[NX * STRIDE + q], block[NY * STRIDE + q], block[NZ * STRIDE + q])
        w = (
            block[IX * STRIDE + q] - block[JX * STRIDE + q],
            block[IY * STRIDE + q] - block[JY * STRIDE + q],
            block[IZ * STRIDE + q] - block[JZ * STRIDE + q],
        )
        t = directional_torque(n, w, law.rolling * block[LOAD * STRIDE + q] * block[arm * STRIDE + q])
        block[RX * STRIDE + q] = t[0]
        block[RY * STRIDE + q] = t[1]
        block[RZ * STRIDE + q] = t[2]


@njit(cache=True)
def note_overlaps(block, monitors):
    """Move the block's largest overlap ratio into the monitors."""
    for q in range(LANES):
        monitors[OVERLAP] = max(monitors[OVERLAP], block[WORST * STRIDE + q])


@njit(cache=True)
def find_contacts(spheres, pairs, count):
    """List the pairs in touch in `pairs.contact`. Returns their number."""
    position, radius = spheres.position, spheres.radius
    start, partner, contact = pairs.start, pairs.partner, pairs.contact
    found = 0
    for i in range(count):
        x, y, z, own = position[i, 0], position[i, 1], position[i, 2], radius[i]
        for k in range(start[i], start[i + 1]):
            j = partner[k]
            dx, dy, dz = x - position[j, 0], y - position[j, 1], z - position[j, 2]
            reach = own + radius[j]
            # Written first, kept by moving on: no branch to mispredict.
            contact[found] = k
            found += dx * dx + dy * dy + dz * dz < reach * reach
    return found


@njit(cache=True)
def gather_pairs(spheres, pairs, block, begin, lanes, step):
    """Copy the states of the contacts `begin ... begin + lanes` into the block.

    A pair that was apart in the step before starts with a slack spring.
    """
    position, velocity, spin = spheres.position, spheres.velocity, spheres.spin
    radius, mass = spheres.radius, spheres.mass
    contact, owner, partner = pairs.contact, pairs.owner, pairs.partner
    touched, spring = pairs.touched, pairs.spring
    for q in range(lanes):
        k = contact[begin + q]
        i, j = owner[k], partner[k]
        held = 1.0 if touched[k] == step - 1 else 0.0
        touched[k] = step
        for a in range(3):
            block[(NX + a) * STRIDE + q] = position[i, a] - position[j, a]
            block[(UX + a) * STRIDE + q] = velocity[i, a] - velocity[j, a]
            block[(IX + a) * STRIDE + q] = spin[i, a]
            block[(JX + a) * STRIDE + q] = spin[j, a]
            block[(XI_X + a) * STRIDE + q] = held * spring[k, a]
        block[RADIUS_I * STRIDE + q] = radius[i]
        block[RADIUS_J * STRIDE + q] = radius[j]
        block[MASS_I * STRIDE + q] = mass[i]
        block[MASS_J * STRIDE + q] = mass[j]


@njit(cache=True, error_model="numpy")
def meet_pairs(block, lanes):
    """Geometry and relative surface velocity of gathered pairs.

    l = R - delta/2 on both sides, v = v_i - v_j - (l_i omega_i + l_j omega_j) x n: a free cluster keeps its
    linear and angular momentum.
    """
    for q in range(lanes):
        dx, dy, dz = block[NX * STRIDE + q], block[NY * STRIDE + q], block[NZ * STRIDE + q]
        r_i, r_j = block[RADIUS_I * STRIDE + q], block[RADIUS_J * STRIDE + q]
        m_i, m_j = block[MASS_I * STRIDE + q], block[MASS_J * STRIDE + q]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        inverse = 1.0 / distance
        delta = r_i + r_j - distance
        nx, ny, nz = dx * inverse, dy * inverse, dz * inverse
        l_i, l_j = r_i - 0.5 * delta, r_j - 0.5 * delta
        sx = l_i * block[IX * STRIDE + q] + l_j * block[JX * STRIDE + q]
        sy = l_i * block[IY * STRIDE + q] + l_j * block[JY * STRIDE + q]
        sz = l_i * block[IZ * STRIDE + q] + l_j * block[JZ * STRIDE + q]
        block[DELTA * STRIDE + q] = delta
        block[NX * STRIDE + q] = nx
        block[NY * STRIDE + q] = ny
        block[NZ * STRIDE + q] = nz
        block[VX * STRIDE + q] = block[UX * STRIDE + q] - (sy * nz - sz * ny)
        block[VY * STRIDE + q] = block[UY * STRIDE + q] - (sz * nx - sx * nz)
        block[VZ * STRIDE + q] = block[UZ * STRIDE + q] - (sx * ny - sy * nx)
        block[RADIUS * STRIDE + q] = r_i * r_j / (r_i + r_j)
        block[MASS * STRIDE + q] = m_i * m_j / (m_i + m_j)
        block[SMALLER * STRIDE + q] = min(r_i, r_j)
        block[ARM_I * STRIDE + q] = l_i
        block[ARM_J * STRIDE + q] = l_j


@njit(cache=True)
def scatter_pairs(spheres, pairs, block, begin, lanes, rolling, friction):
    """Add the block's forces and torques to both spheres of each contact; keep the springs."""
    force, torque, rolling_limit = spheres.force, spheres.torque, spheres.rolling_limit
    contact, owner, partner, spring = pairs.contact, pairs.owner, pairs.partner, pairs.spring
    for q in range(lanes):
        k = contact[begin + q]
        i, j = owner[k], partner[k]
        l_i, l_j = block[ARM_I * STRIDE + q], block[ARM_J * STRIDE + q]
        for a in range(3):
            f, t = block[(FX + a) * STRIDE + q], block[(TX + a) * STRIDE + q]
            spring[k, a] = block[(XI_X + a) * STRIDE + q]
            force[i, a] += f
            force[j, a] -= f
            torque[i, a] += l_i * t
            torque[j, a] += l_j * t
        if rolling == ROLLING_EDEM:
            limit = friction * block[LOAD * STRIDE + q]
            rolling_limit[i] += limit * l_i
            rolling_limit[j] += limit * l_j
        elif rolling == ROLLING_CDT:
            for a in range(3):
                torque[i, a] += block[(RX + a) * STRIDE + q]
                torque[j, a] -= block[(RX + a) * STRIDE + q]


@njit(cache=True)
def pair_forces(spheres, pairs, counters, block, settings):
    """Add the forces between spheres in touch. Returns the number of contacts."""
    contacts = find_contacts(spheres, pairs, counters[COUNT])
    law = settings.pair_law
    for begin in range(0, contacts, LANES):
        lanes = min(LANES, contacts - begin)
        gather_pairs(spheres, pairs, block, begin, lanes, counters[STEP])
        meet_pairs(block, lanes)
        apply_law(block, lanes, law, settings.time_step)
        if settings.rolling == ROLLING_CDT:
            roll_cdt(block, lanes, law, RADIUS)
        scatter_pairs(spheres, pairs, block, begin, lanes, settings.rolling, law.rolling)
    return contacts


@njit(cache=True, error_model="numpy")
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
    return found, radius - distance, n_r / distance, n_z / distance


@njit(cache=True, error_model="numpy")
def gather_touch(spheres, touches, block, q, i, k, delta, n_r, n_z):
    """Fill lane q with sphere i against the wall of entry k: l_i = R_i - delta, a wall at rest."""
    x, y = spheres.position[i, 0], spheres.position[i, 1]
    r = math.sqrt(x * x + y * y)
    # On the axis the meridian plane is arbitrary.
    n = (n_r * x / r, n_r * y / r, n_z) if r > 0.0 else (n_r, 0.0, n_z)
    v, w = spheres.velocity[i], spheres.spin[i]
    arm = spheres.radius[i] - delta
    block[DELTA * STRIDE + q] = delta
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        block[(NX + a) * STRIDE + q] = n[a]
        block[(VX + a) * STRIDE + q] = v[a] - arm * (w[b] * n[c] - w[c] * n[b])
        block[(IX + a) * STRIDE + q] = w[a]
        block[(JX + a) * STRIDE + q] = 0.0
        block[(XI_X + a) * STRIDE + q] = touches.spring[k, a]
    block[RADIUS * STRIDE + q] = block[SMALLER * STRIDE + q] = spheres.radius[i]
    block[MASS * STRIDE + q] = spheres.mass[i]
    block[ARM_I * STRIDE + q] = arm


@njit(cache=True)
def scatter_touches(spheres, touches, walls, block, rows, entries, lanes, rolling, friction):
    """Add the block's forces and torques to the spheres, the reactions to the walls; keep the springs."""
    for q in range(lanes):
        i, k = rows[q], entries[q]
        wall = walls.profile[touches.element[k]]
        arm = block[ARM_I * STRIDE + q]
        for a in range(3):
            f = block[(FX + a) * STRIDE + q]
            touches.spring[k, a] = block[(XI_X + a) * STRIDE + q]
            spheres.force[i, a] += f
            walls.force[wall, a] -= f
            spheres.torque[i, a] += arm * block[(TX + a) * STRIDE + q]
        if rolling == ROLLING_EDEM:
            spheres.rolling_limit[i] += friction * block[LOAD * STRIDE + q] * arm
        elif rolling == ROLLING_CDT:
            for a in range(3):
                spheres.torque[i, a] += block[(RX + a) * STRIDE + q]


@njit(cache=True)
def wall_block(spheres, touches, walls, block, rows, entries, lanes, settings):
    """The law for `lanes` gathered wall contacts, and its scatter."""
    law = settings.wall_law
    apply_law(block, lanes, law, settings.time_step)
    if settings.rolling == ROLLING_CDT:
        roll_cdt(block, lanes, law, ARM_I)
    scatter_touches(spheres, touches, walls, block, rows, entries, lanes, settings.rolling, law.rolling)


@njit(cache=True)
def wall_forces(spheres, touches, walls, counters, block, settings):
    """Add the forces between spheres and walls. Returns the number of contacts."""
    walls.force[:] = 0.0
    rows, entries = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    contacts = lanes = 0
    for i in range(counters[COUNT]):
        for k in range(touches.start[i], touches.start[i + 1]):
            r = math.sqrt(spheres.position[i, 0] ** 2 + spheres.position[i, 1] ** 2)
            element, delta, n_r, n_z = deepest(
                walls, touches.first[k], touches.last[k], r, spheres.position[i, 2], spheres.radius[i]
            )
            if element < 0 and touches.element[k] >= 0:
                touches.spring[k, 0] = touches.spring[k, 1] = touches.spring[k, 2] = 0.0
            touches.element[k] = element
            if element < 0:
                continue
            gather_touch(spheres, touches, block, lanes, i, k, delta, n_r, n_z)
            rows[lanes], entries[lanes] = i, k
            lanes += 1
            contacts += 1
            if lanes == LANES:
                wall_block(spheres, touches, walls, block, rows, entries, lanes, settings)
                lanes = 0
    wall_block(spheres, touches, walls, block, rows, entries, lanes, settings)
    return contacts
