"""Leapfrog: kick, brake, drift; and taking out what crossed the sensor."""

import math

from numba import njit

from hopperopt.dem.laws import braked
from hopperopt.dem.state import COUNT, OPENED, PARKED, SPEED, STALE, STEP


@njit(cache=True)
def clear_forces(spheres, count):
    """Zero the sums of the contacts."""
    spheres.force[:count] = 0.0
    spheres.torque[:count] = 0.0
    spheres.rolling_limit[:count] = 0.0


@njit(cache=True, error_model="numpy")
def kick_and_drift(spheres, counters, monitors, settings):
    """Advance velocities and spins by one step's forces, brake the spins, then move the spheres.

    Marks the lists stale when a sphere has left its skin (or is no longer a number). Notes the largest
    squared ratio of speed to the fall speed sqrt(v0^2 + 2 g (highest start - z)), both at the time of the
    positions that the forces belong to: the mean of the old and the new velocity. Returns how many spheres
    have just passed the sensor.
    """
    dt, g = settings.time_step, settings.gravity
    weight = math.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    position, velocity, spin = spheres.position, spheres.velocity, spheres.spin
    force, torque, rolling_limit = spheres.force, spheres.torque, spheres.rolling_limit
    reference, skin, radius = spheres.reference, spheres.skin, spheres.radius
    fastest = monitors[SPEED]
    beyond = 0
    stale = False
    for i in range(counters[COUNT]):
        mass = spheres.mass[i]
        inertia = 0.4 * mass * radius[i] ** 2
        per_mass, per_inertia = dt / mass, dt / inertia
        speed2 = moved2 = 0.0
        for a in range(3):
            kick = force[i, a] * per_mass + g[a] * dt
            v = velocity[i, a] + kick
            x = position[i, a] + v * dt
            velocity[i, a] = v
            position[i, a] = x
            spin[i, a] += torque[i, a] * per_inertia
            speed2 += (v - 0.5 * kick) ** 2
            moved2 += (x - reference[i, a]) ** 2
        if rolling_limit[i] > 0.0:
            keep = braked((spin[i, 0], spin[i, 1], spin[i, 2]), rolling_limit[i], inertia, dt)
            for a in range(3):
                spin[i, a] *= keep
        stale |= not moved2 <= skin[i] ** 2
        z = position[i, 2]
        beyond += PARKED / 2.0 < z < settings.sensor
        before = z - velocity[i, 2] * dt
        head = settings.start_speed2 + 2.0 * weight * max(settings.highest - before, 0.0)
        if speed2 > fastest * head:
            fastest = speed2 / head
    monitors[SPEED] = fastest
    if stale:
        counters[STALE] = 1
    counters[STEP] += 1
    return beyond


@njit(cache=True)
def take_out(spheres, exit_time, counters, settings):
    """Park the spheres whose centre crossed the sensor in this step; their exit times by interpolation (s).

    A parked sphere touches nothing, never makes the lists stale, and is dropped when they are rebuilt.
    """
    taken = 0
    for i in range(counters[COUNT]):
        z = spheres.position[i, 2]
        if not (PARKED / 2.0 < z < settings.sensor):
            continue
        late = (z - settings.sensor) / spheres.velocity[i, 2]  # time since the crossing
        exit_time[spheres.identity[i]] = (counters[STEP] - counters[OPENED]) * settings.time_step - late
        spheres.position[i, 2] = PARKED - spheres.identity[i]  # a metre apart: they must not meet there
        for a in range(3):
            spheres.velocity[i, a] = 0.0
        spheres.skin[i] = math.inf
        taken += 1
    return taken
