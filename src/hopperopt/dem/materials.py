"""Effective constants of two materials in contact."""

import math

from hopperopt.dem.state import Law


def youngs_modulus(shear_modulus, poisson_ratio):
    """E = 2 G (1 + nu), Pa."""
    return 2.0 * shear_modulus * (1.0 + poisson_ratio)


def damping_ratio(restitution):
    """beta = -ln e / sqrt(ln^2 e + pi^2); 1 for e = 0."""
    if restitution == 0.0:
        return 1.0
    return -math.log(restitution) / math.sqrt(math.log(restitution) ** 2 + math.pi**2)


def contact_law(first, second, restitution, friction, rolling):
    """Law for two materials, each a (shear modulus in Pa, Poisson's ratio) pair; inf is a rigid wall.

    1/E* = sum (1 - nu^2)/E and 1/G* = sum (2 - nu)/G over the two materials.
    """
    materials = (first, second)
    return Law(
        modulus=1.0 / sum((1.0 - nu**2) / youngs_modulus(g, nu) for g, nu in materials),
        shear_modulus=1.0 / sum((2.0 - nu) / g for g, nu in materials),
        damping=2.0 * math.sqrt(5.0 / 6.0) * damping_ratio(restitution),
        friction=float(friction),
        rolling=float(rolling),
    )


def rayleigh_time(radius, density, shear_modulus, poisson_ratio):
    """Rayleigh time step pi R sqrt(rho / G) / (0.1631 nu + 0.8766) of a sphere, s."""
    return math.pi * radius * math.sqrt(density / shear_modulus) / (0.1631 * poisson_ratio + 0.8766)
