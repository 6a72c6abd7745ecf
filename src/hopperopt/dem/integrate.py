"""Leapfrog: kick, brake, drift, chunk by chunk; and taking out what crossed the sensor."""

import math

import numpy as np
from numba import njit

from hopperopt.dem.laws import FAST, braked
from hopperopt.dem.state import (
    BEYOND,
    CHUNKS,
    COUNT,
    FASTEST,
    MOTION,
    MOVED,
    ONE,
    OPENED,
    PARKED,
    PER_INERTIA,
    PER_MASS,
    PLACE,
    ROLLING_LIMIT,
    SKIN,
    SPEED,
    SPIN,
    STALE,
    STEP,
    SUMS,
    TORQUE,
    TWO,
)


@njit(**FAST)
def clear_sums(c, spheres, chunks):
    """Zero the sums of chunk c's contacts: of its own rows and of those in its window."""
    sums = spheres.sums
    ahead = chunks.reach[c] - chunks.first[c + 1]
    sums[chunks.first[c] : chunks.first[c + 1]] = 0.0
    sums[chunks.window[c] : chunks.window[c] + ahead] = 0.0


@njit(**FAST)
def add_windows(c, spheres, chunks):
    """Add what the chunks before c pushed its spheres with, in the order of the chunks."""
    sums = spheres.sums.ravel()
    for earlier in range(c):
        begin = SUMS * np.uint64(chunks.first[c])
        end = SUMS * np.uint64(min(chunks.first[c + 1], chunks.reach[earlier]))
        shift = SUMS * np.uint64(chunks.window[earlier] - chunks.first[earlier + 1])
        for k in range(begin, max(begin, end)):
            sums[k] += sums[k + shift]


@njit(**FAST)
def kick_and_drift(c, spheres, chunks, settings):
    """Advance velocities and spins of chunk c by one step's forces, brake the spins, then move the spheres.

    Notes in `chunks.seen` the largest squared ratio of speed to the fall speed sqrt(v0^2 + 2 g (highest start
    - z)), both at the time of the positions that the forces belong to (the mean of the old and the new
    velocity); how many spheres have just passed the sensor; and whether one has left its skin (or is no
    longer a number).
    """
    dt, g = settings.time_step, settings.gravity
    place, motion, sums = spheres.place.ravel(), spheres.motion.ravel(), spheres.sums.ravel()
    anchor = spheres.anchor.ravel()
    twice_weight = 2.0 * math.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    fall = (g[0] * dt, g[1] * dt, g[2] * dt)
    fastest = 0.0
    beyond = moved = 0
    for i in range(np.uint64(chunks.first[c]), np.uint64(chunks.first[c + 1])):
        p, m, s = PLACE * i, MOTION * i, SUMS * i
        per_mass, per_inertia = dt * motion[m + PER_MASS], dt * motion[m + PER_INERTIA]
        kick = (
            sums[s] * per_mass + fall[0],
            sums[s + ONE] * per_mass + fall[1],
            sums[s + TWO] * per_mass + fall[2],
        )
        v = (motion[m] + kick[0], motion[m + ONE] + kick[1], motion[m + TWO] + kick[2])
        before = place[p + TWO]
        x, y, z = place[p] + v[0] * dt, place[p + ONE] + v[1] * dt, before + v[2] * dt
        w = (
            motion[m + SPIN] + sums[s + TORQUE] * per_inertia,
            motion[m + SPIN + ONE] + sums[s + TORQUE + ONE] * per_inertia,
            motion[m + SPIN + TWO] + sums[s + TORQUE + TWO] * per_inertia,
        )
        keep = braked(w, sums[s + ROLLING_LIMIT] * per_inertia)
        motion[m], motion[m + ONE], motion[m + TWO] = v
        place[p], place[p + ONE], place[p + TWO] = x, y, z
        motion[m + SPIN], motion[m + SPIN + ONE] = keep * w[0], keep * w[1]
        motion[m + SPIN + TWO] = keep * w[2]

        gone2 = (x - anchor[p]) ** 2 + (y - anchor[p + ONE]) ** 2 + (z - anchor[p + TWO]) ** 2
        moved += not gone2 <= anchor[p + SKIN] ** 2
        beyond += PARKED / 2.0 < z < settings.sensor
        speed2 = (v[0] - 0.5 * kick[0]) ** 2 + (v[1] - 0.5 * kick[1]) ** 2 + (v[2] - 0.5 * kick[2]) ** 2
        head = settings.start_speed2 + twice_weight * max(settings.highest - before, 0.0)
        if speed2 > fastest * head:
            fastest = speed2 / head
    chunks.seen[c, FASTEST] = fastest
    chunks.seen[c, BEYOND] = beyond
    chunks.seen[c, MOVED] = moved


@njit(**FAST)
def conclude(chunks, counters, monitors):
    """Put together what the chunks have seen in a step. Returns how many spheres have just passed the
    sensor."""
    beyond = 0.0
    for c in range(counters[CHUNKS]):
        monitors[SPEED] = max(monitors[SPEED], chunks.seen[c, FASTEST])
        beyond += chunks.seen[c, BEYOND]
        if chunks.seen[c, MOVED] > 0.0:
            counters[STALE] = 1
    counters[STEP] += 1
    return beyond


@njit(**FAST)
def take_out(spheres, exit_time, counters, settings):
    """Park the spheres whose centre crossed the sensor in this step; their exit times by interpolation (s).

    A parked sphere touches nothing, never makes the lists stale, and is dropped when they are rebuilt.
    """
    taken = 0
    for i in range(counters[COUNT]):
        z = spheres.place[i, 2]
        if not (PARKED / 2.0 < z < settings.sensor):
            continue
        late = (z - settings.sensor) / spheres.motion[i, 2]  # time since the crossing
        exit_time[spheres.identity[i]] = (counters[STEP] - counters[OPENED]) * settings.time_step - late
        spheres.place[i, 2] = PARKED - spheres.identity[i]  # a metre apart: they must not meet there
        for a in range(3):
            spheres.motion[i, a] = 0.0
        spheres.anchor[i, SKIN] = math.inf
        taken += 1
    return taken
