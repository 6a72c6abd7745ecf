"""What the hardest impacts of a filling do, estimated before it is simulated.

Two bounds of the monitors come from the model and not from the solver: soft spheres are crushed by heavy ones
that fall on them, and light spheres fly off heavy ones faster than anything falls. In some hundred random
designs (see docs/robustness.md) a run comes up to 1.2 times the estimates and hardly beyond.
"""

import math


def compression(fine, coarse, density, modulus, speed):
    """Overlap, over its radius, of a fine sphere on which a coarse one falls while another body is below it.

    Each of the two contacts takes half of the coarse sphere's energy: 8/15 E* sqrt(R*) delta^2.5 = m v^2 / 4.
    Arguments: diameters, m; density, kg/m3; effective modulus E*, Pa; speed of the fall, m/s.
    """
    mass = math.pi / 6 * density * coarse**3
    radius = 0.5 * fine * coarse / (fine + coarse)
    delta = (15 / 32 * mass * speed**2 / (modulus * math.sqrt(radius))) ** 0.4
    return delta / (fine / 2)


def rebound(diameters, restitution, wall_restitution):
    """Largest speed after head-on impacts over the speed of the fall, at least 1.

    A sphere that has rebounded from the wall meets a heavier one that falls: either the coarse one, or an
    intermediate one that the coarse one has just hit in the same way. Arguments: diameters (fine,
    intermediate, coarse), restitution between spheres and with the wall.
    """

    def hit(light, heavy, speed):
        share = heavy**3 / (light**3 + heavy**3)
        return (1 + restitution) * (speed + wall_restitution) * share - wall_restitution

    fine, intermediate, coarse = diameters
    return max(1.0, hit(fine, coarse, 1.0), hit(fine, intermediate, hit(intermediate, coarse, 1.0)))
