"""One impact under the contact law in continuous time, solved to high order: the yardstick where it sticks.

Planar, written from the equations and apart from the solver. The sphere i lies above j (another sphere, or a
plane at rest where R_j is infinite); x along the tangent at first touch, z from j to i, spins about y.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass(frozen=True)
class Impact:
    """Radii (m) and masses (kg) of both bodies, effective moduli (Pa), restitution, friction."""

    radius: tuple
    mass: tuple
    modulus: float
    shear_modulus: float
    restitution: float
    friction: float


class _Contact:
    """The law at one state y = (x, z from touching, their rates, spins of i and j, spring s along t)."""

    def __init__(self, impact, y, slides):
        x, z, u, v, w_i, w_j, s = y
        r_i, r_j = impact.radius
        log_e = np.log(impact.restitution)
        beta = -log_e / np.hypot(log_e, np.pi)
        if np.isinf(r_j):
            self.n, delta, self.r, self.m = (0.0, 1.0), -z, r_i, impact.mass[0]
            self.arms = (r_i - delta, 0.0)
        else:
            apart = np.hypot(x, r_i + r_j + z)
            self.n, delta = (x / apart, (r_i + r_j + z) / apart), r_i + r_j - apart
            self.r, self.m = r_i * r_j / (r_i + r_j), 1.0 / (1.0 / impact.mass[0] + 1.0 / impact.mass[1])
            self.arms = (r_i - delta / 2.0, r_j - delta / 2.0)
        n_x, n_z = self.n
        self.delta = delta
        self.v_n = u * n_x + v * n_z
        # The tangent is n turned to +x; omega x n points along it for a spin about +y.
        self.v_t = u * n_z - v * n_x - self.arms[0] * w_i - self.arms[1] * w_j
        self.widening = -impact.friction * impact.modulus / (6.0 * impact.shear_modulus) * self.v_n
        self.bound = impact.friction * impact.modulus / (6.0 * impact.shear_modulus) * delta  # mu N / S_t
        a = np.sqrt(self.r * max(delta, 0.0))
        s_n, s_t = 2.0 * impact.modulus * a, 8.0 * impact.shear_modulus * a
        load = 2.0 / 3.0 * s_n * delta
        damping = 2.0 * np.sqrt(5.0 / 6.0) * beta
        self.normal = load - damping * np.sqrt(s_n * self.m) * self.v_n
        self.spring = slides * self.bound if slides else s
        pull = s_t * self.spring + damping * np.sqrt(s_t * self.m) * self.v_t
        limit = impact.friction * max(load, 0.0)
        self.tangential = -min(max(pull, -limit), limit)


def _rates(_, y, impact, slides):
    c = _Contact(impact, y, slides)
    n_x, n_z = c.n
    f_x, f_z = c.normal * n_x + c.tangential * n_z, c.normal * n_z - c.tangential * n_x
    brake = [
        -arm * c.tangential / (0.4 * mass * radius**2) if arm else 0.0
        for arm, mass, radius in zip(c.arms, impact.mass, impact.radius, strict=True)
    ]
    return [y[2], y[3], f_x / c.m, f_z / c.m, *brake, 0.0 if slides else c.v_t]


def _ends(_, y, impact, slides):
    return _Contact(impact, y, slides).delta


def _changes(_, y, impact, slides):
    """Below zero while a sticking spring is inside its bound; above while a sliding one would leave it."""
    c = _Contact(impact, y, slides)
    return slides * c.v_t - c.widening if slides else abs(c.spring) - c.bound


def rebound(impact, velocity, spin=(0.0, 0.0)):
    """Relative velocity (x, z; m/s) and the two spins (rad/s) after the impact, (4,).

    Coulomb's limit is a bound mu N / S_t on the spring: free inside, the spring obeys ds/dt = v_t; at the
    bound it moves with it, until the surfaces would draw it back faster than the bound moves. Both changes,
    and the end of the contact at delta = 0, are events.
    """
    y = np.array([0.0, 0.0, *velocity, *spin, 0.0])
    c = _Contact(impact, y, 0)
    slides = np.sign(c.v_t) if abs(c.v_t) > c.widening else 0.0
    speed = np.hypot(c.v_t, c.v_n)
    depth = (15.0 / 16.0 * c.m * c.v_n**2 / (impact.modulus * np.sqrt(c.r))) ** 0.4
    scale = np.array([depth, depth, speed, speed, speed / impact.radius[0], speed / impact.radius[0], depth])
    time, last = 0.0, 50.0 * depth / -c.v_n
    for _ in range(100):
        _ends.terminal, _ends.direction = True, -1
        _changes.terminal, _changes.direction = True, -1 if slides else 1
        leg = solve_ivp(
            _rates,
            (time, last),
            y,
            "DOP853",
            args=(impact, slides),
            events=(_ends, _changes),
            first_step=1e-4 * depth / speed,
            rtol=1e-9,
            atol=1e-12 * scale,
        )
        time, y = leg.t[-1], leg.y[:, -1].copy()
        if leg.t_events[0].size:
            return y[2:6]
        if leg.status != 1:
            break
        c = _Contact(impact, y, slides)
        y[6] = c.spring
        slides = 0.0 if slides else np.sign(c.spring)
    raise ArithmeticError("the impact does not end")
