"""Sums over the state: energies."""

import math

from numba import njit

from hopperopt.dem.contacts import deepest
from hopperopt.dem.laws import elastic_energy
from hopperopt.dem.state import COUNT, PARKED, STEP


@njit(cache=True)
def motion_energies(spheres, counters, settings):
    """Kinetic (translation and spin) and gravitational energy, J.

    Velocities live half a step before the positions, so the heights are taken there, too.
    """
    kinetic = potential = 0.0
    half = 0.5 * settings.time_step
    for i in range(counters[COUNT]):
        if spheres.position[i, 2] <= PARKED / 2.0:
            continue  # it has left
        mass = spheres.mass[i]
        inertia = 0.4 * mass * spheres.radius[i] ** 2
        for a in range(3):
            v, w = spheres.velocity[i, a], spheres.spin[i, a]
            kinetic += 0.5 * (mass * v * v + inertia * w * w)
            potential -= mass * settings.gravity[a] * (spheres.position[i, a] - half * v)
    return kinetic, potential


@njit(cache=True, error_model="numpy")
def spring_energy(spheres, pairs, touches, walls, counters, settings):
    """Elastic energy of all contacts with the springs of the last step, J, half a step back like the
    motion."""
    total = 0.0
    half = 0.5 * settings.time_step
    for i in range(counters[COUNT]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = pairs.partner[k]
            squared = 0.0
            for a in range(3):
                d = spheres.position[i, a] - spheres.position[j, a]
                d -= half * (spheres.velocity[i, a] - spheres.velocity[j, a])
                squared += d * d
            r_i, r_j = spheres.radius[i], spheres.radius[j]
            delta = r_i + r_j - math.sqrt(squared)
            if delta > 0.0:
                held = 1.0 if pairs.touched[k] == counters[STEP] - 1 else 0.0
                x, y, z = pairs.spring[k, 0], pairs.spring[k, 1], pairs.spring[k, 2]
                total += elastic_energy(
                    delta, (held * x, held * y, held * z), r_i * r_j / (r_i + r_j), settings.pair_law
                )
        for k in range(touches.start[i], touches.start[i + 1]):
            x = spheres.position[i, 0] - half * spheres.velocity[i, 0]
            y = spheres.position[i, 1] - half * spheres.velocity[i, 1]
            z = spheres.position[i, 2] - half * spheres.velocity[i, 2]
            element, delta, _, _ = deepest(
                walls, touches.first[k], touches.last[k], math.sqrt(x * x + y * y), z, spheres.radius[i]
            )
            if element >= 0:
                xi = touches.spring[k]
                total += elastic_energy(delta, (xi[0], xi[1], xi[2]), spheres.radius[i], settings.wall_law)
    return total


def energies(spheres, pairs, touches, walls, counters, settings):
    """Kinetic, gravitational and elastic energy, J."""
    kinetic, potential = motion_energies(spheres, counters, settings)
    return kinetic, potential, spring_energy(spheres, pairs, touches, walls, counters, settings)
