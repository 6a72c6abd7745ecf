"""The contact law: Hertz-Mindlin with centred dashpots, Coulomb's limit and rolling friction.

Symbols: delta overlap, n unit normal towards the sphere, v velocity of the sphere's surface relative to the
other body at the contact, xi tangential spring, R and m the pair's effective radius and mass (1/R = 1/R_i +
1/R_j, 1/m = 1/m_i + 1/m_j; a wall leaves the sphere's own), E and G the effective moduli.

Both dashpots are centred: the velocity at hand is that of the half step before, and dividing by 1 + c makes
the force that of the mean of the old and the new velocity, to second order for an isolated contact.
"""

import math

from numba import njit

# A fused multiply-add rounds once instead of twice; nothing else of the usual arithmetic is given up.
FAST = {"cache": True, "error_model": "numpy", "fastmath": {"contract"}}
INLINE = FAST | {"forceinline": True}
TINY = 1.0e-300  # keeps 0 / 0 away


@njit(**INLINE)
def hertz_mindlin(delta, n, v, xi, radius, mass, per_mass, law, dt):
    """Force of one contact on the sphere that n points to, and its spring after the step.

    Arguments: delta > 0 (m); n, v (m/s), xi (m) as 3-tuples; effective radius R (m), mass m (kg) and 1/m (a
    division that the caller can save); the `Law`; the time step (s). Returns (normal force with dashpot, N;
    elastic load N that friction refers to, N; tangential force, 3-tuple, N; xi, 3-tuple, m).

    - normal: (F_el - gamma_n v_n) / (1 + c_n), F_el = 4/3 E sqrt(R) delta^1.5, S_n = 2 E sqrt(R delta),
      gamma_n = 2 sqrt(5/6) beta sqrt(S_n m), c_n = gamma_n dt / (2 m). It may pull: the contact ends at delta
      = 0.
    - load N = F_el / (1 + c_n): what a contact held by its neighbours transmits at rest.
    - tangential: -(S_t xi + gamma_t v_t) / (1 + c_t), S_t = 8 G sqrt(R delta), c_t = gamma_t dt / (2 * 2/7
      m).
    - Coulomb: |xi| <= (1 + c_t) mu N / S_t and the tangential force <= mu N.
    """
    t_over_n = 4.0 * law.shear_modulus / law.modulus  # S_t / S_n, the same for all contacts
    s_n = 2.0 * law.modulus * math.sqrt(radius * delta)
    s_t = t_over_n * s_n
    elastic = 2.0 / 3.0 * s_n * delta
    rate_n = law.damping * math.sqrt(s_n * per_mass)  # gamma / m: the roots and divisions are what costs
    rate_t = math.sqrt(t_over_n) * rate_n
    gamma_n, gamma_t = rate_n * mass, rate_t * mass
    c_n = 0.5 * rate_n * dt
    c_t = 1.75 * rate_t * dt
    both = 1.0 / ((1.0 + c_n) * (1.0 + c_t))
    centred_n, centred_t = both * (1.0 + c_t), both * (1.0 + c_n)

    v_n = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    normal = (elastic - gamma_n * v_n) * centred_n
    load = elastic * centred_n

    vx, vy, vz = v[0] - v_n * n[0], v[1] - v_n * n[1], v[2] - v_n * n[2]
    x, y, z = xi[0] + vx * dt, xi[1] + vy * dt, xi[2] + vz * dt
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]

    limit = law.friction * load
    keep = min(1.0, (1.0 + c_t) * limit / (s_t * math.sqrt(x * x + y * y + z * z) + TINY))
    x, y, z = keep * x, keep * y, keep * z
    fx = -(s_t * x + gamma_t * vx) * centred_t
    fy = -(s_t * y + gamma_t * vy) * centred_t
    fz = -(s_t * z + gamma_t * vz) * centred_t
    keep = min(1.0, limit / (math.sqrt(fx * fx + fy * fy + fz * fz) + TINY))
    return normal, load, (keep * fx, keep * fy, keep * fz), (x, y, z)


@njit(**FAST)
def elastic_energy(delta, xi, radius, law):
    """Energy stored in a contact's two springs, J: 2/5 F_el delta + 1/2 S_t xi^2."""
    a = math.sqrt(radius * delta)
    normal = 8.0 / 15.0 * law.modulus * a * delta * delta
    return normal + 4.0 * law.shear_modulus * a * (xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2)


@njit(**INLINE)
def directional_torque(n, w, torque):
    """Rolling torque of the `cdt` model: `torque` (N m) against the relative spin w, without its part along
    n.

    Ai, Chen, Rotter, Ooi, Powder Technology 206 (2011) 269, model A, as LIGGGHTS applies it.
    """
    factor = -torque / (math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) + TINY)
    along = w[0] * n[0] + w[1] * n[1] + w[2] * n[2]
    return (
        factor * (w[0] - along * n[0]),
        factor * (w[1] - along * n[1]),
        factor * (w[2] - along * n[2]),
    )


@njit(**INLINE)
def braked(spin, slowing):
    """Factor on a spin (3-tuple, rad/s) after rolling friction has braked it for one step.

    Argument: `slowing` T dt / I (rad/s), T the summed limit of the sphere's contacts. The factor
    max(0, 1 - T dt / (I |omega|)) stops the spin, and cannot reverse it (a constant torque along -omega; all
    contacts of a sphere share that direction).
    """
    speed = math.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2])
    return max(0.0, 1.0 - slowing / (speed + TINY))
