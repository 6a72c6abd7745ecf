"""Set-ups that several cases share: the study's materials and impacts by the hundred.

Independent impacts fly side by side in one simulation, some diameters apart.
"""

import numpy as np

from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import Simulation

# The study's materials: shear modulus (Pa) and Poisson's ratio, density (kg/m3), time step (s).
PARTICLE, PLEXIGLASS = (1.0e7, 0.25), (2.2e7, 0.25)
DENSITY, TIME_STEP = 2285.0, 4.0e-5
RIGID = (np.inf, 0.25)
GRAVITY = 9.81  # m/s2


def pair_law(restitution=0.7, friction=0.5, rolling=0.05):
    """Law between two particles of the study, with what a case wants different."""
    return contact_law(PARTICLE, PARTICLE, restitution, friction, rolling)


def wall_law(restitution=0.2, friction=0.5, rolling=0.25):
    """Law between a particle and a wall of the study, with what a case wants different."""
    return contact_law(PARTICLE, PLEXIGLASS, restitution, friction, rolling)


def shear_modulus(youngs, poisson):
    """G = E / (2 (1 + nu)), Pa."""
    return youngs / (2.0 * (1.0 + poisson))


def sphere_mass(radius, density=DENSITY):
    """Mass of a sphere, kg."""
    return density * 4.0 / 3.0 * np.pi * np.asarray(radius) ** 3


def effective(radius, density=DENSITY):
    """Effective radius (m) and mass (kg), (n,), of spheres on a plane, radii (n, 1), or pairs, (n, 2)."""
    radius = np.atleast_2d(radius)
    return 1.0 / (1.0 / radius).sum(axis=1), 1.0 / (1.0 / sphere_mass(radius, density)).sum(axis=1)


def hertz_overlap(speed, radius, mass, modulus):
    """Deepest overlap (15/16 m v^2 / (E sqrt R))^(2/5) of an elastic impact, m."""
    return (15.0 / 16.0 * mass * speed**2 / (modulus * np.sqrt(radius))) ** 0.4


def hertz_duration(speed, radius, mass, modulus):
    """Duration 2.9432 delta / v of an elastic impact, s."""
    return 2.9432 * hertz_overlap(speed, radius, mass, modulus) / speed


def on_floor(radius, velocity, law, time_step, *, gap=0.0, gravity=0.0, spin=None, density=DENSITY,
             rolling="none", pitch=None):  # fmt: skip
    """Spheres side by side over a floor at z = 0, in a `Simulation`; `gap` (m) is below each."""
    radius = np.asarray(radius, dtype=float)
    places = _grid(len(radius), pitch or 4.0 * radius.max())
    position = np.column_stack([places, radius + gap])
    floor = {"floor": [[0.0, 0.0], [2.0 * np.abs(places).max() + 1.0, 0.0]]}
    return Simulation(position, velocity, radius, density, floor, law, law, time_step, gravity, rolling, spin)


def impacts(law, radius, velocity, time_step, *, gap=0.0, spin=None, density=DENSITY, rolling="none"):
    """Velocities (m/s) and spins (rad/s) after impacts without weight, (n, k, 3) each.

    Arguments: `radius` (n, k) m, k = 1 for spheres on the floor and k = 2 for pairs, the first above the
    second; `velocity` and `spin` (n, k, 3), closing along z; `gap` (n,) m, closed at first touch, when the
    centres lie along z. All impacts end before this returns, but those of a restitution so low that the
    bodies stay together.
    """
    radius, velocity = np.asarray(radius, dtype=float), np.ascontiguousarray(velocity, dtype=float)
    n, k = radius.shape
    spin = np.zeros_like(velocity) if spin is None else np.ascontiguousarray(spin, dtype=float)
    closing = -velocity[:, 0, 2] + (velocity[:, 1, 2] if k == 2 else 0.0)
    longest = (gap / closing + 2.0 * hertz_duration(closing, *effective(radius, density), law.modulus)).max()
    pitch = 4.0 * radius.max() + 4.0 * longest * np.abs(velocity).max()
    flat = velocity.reshape(-1, 3), spin.reshape(-1, 3)
    if k == 1:
        sim = on_floor(radius[:, 0], flat[0], law, time_step, gap=gap, spin=flat[1], density=density,
                       rolling=rolling, pitch=pitch)  # fmt: skip
    else:
        position = np.zeros((n, 2, 3))
        position[:, :, :2] = _grid(n, pitch)[:, None, :]
        position[:, 0, 2] = radius.sum(axis=1)
        position[:, 0] -= (velocity[:, 0] - velocity[:, 1]) * np.broadcast_to(gap / closing, n)[:, None]
        sim = Simulation(position.reshape(-1, 3), flat[0], radius.ravel(), density, {}, law, law, time_step,
                         0.0, rolling, flat[1])  # fmt: skip
    sim.advance(round(longest / time_step))
    for _ in range(8):  # strong damping makes contacts last longer
        if not sim.contacts().any():
            break
        sim.advance(round(longest / time_step))
    after = sim.by_identity(sim.spheres.velocity), sim.by_identity(sim.spheres.spin)
    return tuple(values.reshape(n, k, 3) for values in after)


def kinetic_energy(radius, velocity, spin, density=DENSITY):
    """Energy of translation and spin, J, of impacts in the arrays of `impacts`; (n,)."""
    mass = sphere_mass(radius, density)[..., None]
    inertia = 0.4 * mass * np.asarray(radius)[..., None] ** 2
    return 0.5 * (mass * velocity**2 + inertia * spin**2).sum(axis=(1, 2))


def _grid(count, pitch):
    """`count` places on a square grid around the axis, none of them on it, (count, 2) m."""
    side = np.arange(int(np.ceil(np.sqrt(count)))) - 0.5 * np.sqrt(count) + 0.1
    places = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return pitch * places[:count]
