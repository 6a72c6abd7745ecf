"""What the hardest impacts of a filling do, estimated before it is simulated.

Where monitors break, it is by the model's numbers: soft spheres are crushed by heavy ones that fall on them,
a long step cannot follow a sphere that is squeezed so, and light spheres fly off heavy ones faster than
anything falls. docs/robustness.md tells how far these estimates hold in random designs.
"""

import math


def compression(fine, coarse, density, modulus, speed):
    """Overlap, over its radius, of a fine sphere on which a coarse one falls while another body is below it.

    Each of the two contacts takes half of the coarse sphere's energy: 8/15 E* sqrt(R*) delta^2.5 = m v^2 / 4.
    Arguments: diameters, m; density, kg/m3; effective modulus E*, Pa; speed of the fall, m/s.
    """
    mass = math.pi / 6 * density * coarse**3
    delta = (15 / 32 * mass * speed**2 / (modulus * math.sqrt(_effective(fine, coarse)))) ** 0.4
    return delta / (fine / 2)


def swing(fine, coarse, density, moduli, compressed, step):
    """Angular frequency times step of a fine sphere that is compressed between a coarse one and a wall.

    A contact's stiffness is 2 E* sqrt(R* delta); the leapfrog without damping is stable up to 2. Arguments:
    diameters, m; density, kg/m3; effective moduli with spheres and with walls, Pa; overlap over the fine
    sphere's radius; time step, s.
    """
    delta = compressed * fine / 2
    radii = _effective(fine, coarse), fine / 2
    stiffness = sum(2 * e * math.sqrt(r * delta) for e, r in zip(moduli, radii, strict=True))
    return step * math.sqrt(stiffness / (math.pi / 6 * density * fine**3))


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


def _effective(first, second):
    """Effective radius of two spheres of these diameters."""
    return 0.5 * first * second / (first + second)
