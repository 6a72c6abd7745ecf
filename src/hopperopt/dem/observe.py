"""Sums over the state: energies."""

import math

from numba import njit

from hopperopt.dem.contacts import deepest
from hopperopt.dem.laws import elastic_energy
from hopperopt.dem.state import COUNT, PARKED, RADIUS, SPIN, STEP


@njit(cache=True)
def motion_energies(spheres, counters, settings):
    """Kinetic (translation and spin) and gravitational energy, J.

    Velocities live half a step before the positions, so the heights are taken there, too.
    """
    kinetic = potential = 0.0
    half = 0.5 * settings.time_step
    for i in range(counters[COUNT]):
        if spheres.place[i, 2] <= PARKED / 2.0:
            continue  # it has left
        mass = spheres.mass[i]
        inertia = 0.4 * mass * spheres.place[i, RADIUS] ** 2
        for a in range(3):
            v, w = spheres.motion[i, a], spheres.motion[i, SPIN + a]
            kinetic += 0.5 * (mass * v * v + inertia * w * w)
            potential -= mass * settings.gravity[a] * (spheres.place[i, a] - half * v)
    return kinetic, potential


@njit(cache=True, error_model="numpy")
def spring_energy(spheres, pairs, touches, walls, counters, laws, settings):
    """Elastic energy of all contacts with the springs of the last step, J, half a step back like the
    motion."""
    total = 0.0
    half = 0.5 * settings.time_step
    for i in range(counters[COUNT]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = pairs.partner[k]
            squared = 0.0
            for a in range(3):
                d = spheres.place[i, a] - spheres.place[j, a]
                d -= half * (spheres.motion[i, a] - spheres.motion[j, a])
                squared += d * d
            r_i, r_j = spheres.place[i, RADIUS], spheres.place[j, RADIUS]
            delta = r_i + r_j - math.sqrt(squared)
            if delta > 0.0:
                held = 1.0 if pairs.touched[k] == counters[STEP] - 1 else 0.0
                x, y, z = pairs.spring[k, 0], pairs.spring[k, 1], pairs.spring[k, 2]
                total += elastic_energy(
                    delta, (held * x, held * y, held * z), r_i * r_j / (r_i + r_j), laws.pair
                )
        for k in range(touches.start[i], touches.start[i + 1]):
            x = spheres.place[i, 0] - half * spheres.motion[i, 0]
            y = spheres.place[i, 1] - half * spheres.motion[i, 1]
            z = spheres.place[i, 2] - half * spheres.motion[i, 2]
            r, radius = math.sqrt(x * x + y * y), spheres.place[i, RADIUS]
            element, delta, _, _ = deepest(walls, touches.first[k], touches.last[k], r, z, radius)
            if element >= 0:
                xi = touches.spring[k]
                total += elastic_energy(delta, (xi[0], xi[1], xi[2]), radius, laws.wall)
    return total


def energies(spheres, pairs, touches, walls, counters, laws, settings):
    """Kinetic, gravitational and elastic energy, J."""
    kinetic, potential = motion_energies(spheres, counters, settings)
    return kinetic, potential, spring_energy(spheres, pairs, touches, walls, counters, laws, settings)
