"""The whole time step in plain numpy, every sphere against every other: what the compiled solver must do.

Written from the equations, to be read beside them; it shares nothing with the compiled solver, keeps no
neighbour lists and spares no work. Hertz's normal force; Mindlin's tangential spring (no slip) with Coulomb's
limit; dashpots of constant restitution (Tsuji, Tanaka and Ishida, Powder Technology 71 (1992) 239), centred
in time; rolling friction of constant torque (model A of Ai, Chen, Rotter and Ooi, Powder Technology 206
(2011) 269), as a brake ("edem") or as a torque ("cdt"); leapfrog. SI units.
"""

from typing import NamedTuple

import numpy as np

from validation.revolved import Surfaces


class Law(NamedTuple):
    """Effective constants of two materials in contact."""

    E: float  # 1 / E* = sum (1 - nu^2) / E over the two, with E = 2 G (1 + nu); Pa
    G: float  # 1 / G* = sum (2 - nu) / G; Pa
    beta: float  # damping ratio -ln e / sqrt(ln^2 e + pi^2)
    mu_s: float  # Coulomb friction
    mu_r: float  # rolling friction


def law(one, other, restitution, friction, rolling):
    """Law of two materials, each a (shear modulus in Pa, Poisson's ratio)."""
    (G1, nu1), (G2, nu2) = one, other
    E1, E2 = 2 * G1 * (1 + nu1), 2 * G2 * (1 + nu2)
    beta = 1.0
    if restitution > 0:
        beta = -np.log(restitution) / np.hypot(np.log(restitution), np.pi)
    E = 1 / ((1 - nu1**2) / E1 + (1 - nu2**2) / E2)
    G = 1 / ((2 - nu1) / G1 + (2 - nu2) / G2)
    return Law(E, G, beta, friction, rolling)


class Plain:
    """Spheres among walls of revolution, in the order in which they were given; none leaves.

    Arguments: `position`, `velocity`, `spin` (n, 3) in m, m/s, rad/s, the last two half a step behind;
    `radius` (n,) m; `density` kg/m3; `walls`, name -> profile (points, 2) of r and z in m; `pair`, `wall`,
    the laws; `time_step` s; `gravity` (3,) m/s2; `rolling` "edem", "cdt" or "none".
    """

    def __init__(
        self, position, velocity, spin, radius, density, walls, pair, wall, time_step, gravity, rolling
    ):
        self.x, self.v, self.omega = (np.array(a, float) for a in (position, velocity, spin))
        self.R, self.m = radius, density * 4 / 3 * np.pi * radius**3
        self.walls, self.surfaces = dict(walls), Surfaces(walls)
        self.pair, self.wall, self.dt, self.g, self.rolling = pair, wall, time_step, gravity, rolling
        self.i, self.j = np.triu_indices(len(radius), 1)  # every pair
        self.xi = np.zeros((len(self.i), 3))  # m, springs of i against j; zero without contact
        self.xi_wall = np.zeros((len(radius), len(self.surfaces.owner), 3))  # m, against each surface
        # Of the last step: pairs in touch; spheres in touch with surfaces, and with which of their elements;
        # who slides, the pairs first; force of the spheres on each wall (N).
        self.touching = self.touching_wall = self.elements = self.sliding = self.wall_force = None

    def open(self, name):
        """Take a wall away, and the springs against it."""
        stays = [owner != name for owner in self.surfaces.owner]
        del self.walls[name]
        self.surfaces, self.xi_wall = Surfaces(self.walls), self.xi_wall[:, stays]

    def step(self):
        """Forces at the positions with the velocities half a step behind, kick, brake, drift."""
        dt, m, R = self.dt, self.m[:, None], self.R[:, None]
        self.force, self.torque = np.zeros_like(self.x), np.zeros_like(self.x)
        self.limit = np.zeros_like(self.R)  # N m, of the brakes of rolling friction
        self.sliding = np.concatenate([self._pairs(), self._touches()])
        self.v += dt * (self.force / m + self.g)
        inertia = 2 / 5 * m * R**2
        self.omega += dt * self.torque / inertia
        # Rolling friction as a brake: it slows the spin down to nothing and never turns it round.
        spin = np.linalg.norm(self.omega, axis=1, keepdims=True)
        lost = np.divide(dt * self.limit[:, None], inertia * spin, out=np.zeros_like(spin), where=spin > 0)
        self.omega *= np.maximum(0, 1 - lost)
        self.x += dt * self.v

    def _pairs(self):
        """Forces between spheres: `n` points from j to i."""
        apart = self.x[self.i] - self.x[self.j]
        distance = np.linalg.norm(apart, axis=1)
        near = np.flatnonzero(distance < self.R[self.i] + self.R[self.j])
        i, j, apart, distance = self.i[near], self.j[near], apart[near], distance[near]
        n, delta = apart / distance[:, None], self.R[i] + self.R[j] - distance
        R, m = (a[i] * a[j] / (a[i] + a[j]) for a in (self.R, self.m))
        l_i, l_j = self.R[i] - delta / 2, self.R[j] - delta / 2
        turning = l_i[:, None] * self.omega[i] + l_j[:, None] * self.omega[j]
        v = self.v[i] - self.v[j] - np.cross(turning, n)
        F, N, xi, slides = hertz_mindlin(self.pair, self.dt, delta, n, v, self.xi[near], R, m)
        roll = rolling_torque(self.pair.mu_r * N * R, self.omega[i] - self.omega[j], n)
        for k, sign, arm in ((i, 1, l_i), (j, -1, l_j)):
            # The contact lies at -l_i n from i and at +l_j n from j, where -F acts: one sign for both arms.
            np.add.at(self.force, k, sign * F)
            np.add.at(self.torque, k, np.cross(-arm[:, None] * n, F))
            self._roll(k, self.pair.mu_r * N * arm, sign * roll)
        self.xi = np.zeros_like(self.xi)  # a contact that ended forgets
        self.xi[near], self.touching = xi, near
        return slides

    def _touches(self):
        """Forces of the walls, which are at rest: `n` points from the wall to the sphere."""
        i, s, delta, n, self.elements = self.surfaces.contacts(self.x, self.R)
        R, m, arm = self.R[i], self.m[i], self.R[i] - delta
        v = self.v[i] - np.cross(arm[:, None] * self.omega[i], n)
        F, N, xi, slides = hertz_mindlin(self.wall, self.dt, delta, n, v, self.xi_wall[i, s], R, m)
        limit = self.wall.mu_r * N * arm
        np.add.at(self.force, i, F)
        np.add.at(self.torque, i, np.cross(-arm[:, None] * n, F))
        self._roll(i, limit, rolling_torque(limit, self.omega[i], n))
        self.wall_force = {name: np.zeros(3) for name in self.walls}
        for surface, pushed in zip(s, F, strict=True):
            self.wall_force[self.surfaces.owner[surface]] -= pushed
        self.xi_wall = np.zeros_like(self.xi_wall)
        self.xi_wall[i, s], self.touching_wall = xi, (i, s)
        return slides

    def _roll(self, i, limit, torque):
        """Add rolling friction of the spheres `i`: to what the brake may take, or as a torque."""
        if self.rolling == "edem":
            np.add.at(self.limit, i, limit)
        elif self.rolling == "cdt":
            np.add.at(self.torque, i, torque)


def hertz_mindlin(law, dt, delta, n, v, xi, R, m):
    """Forces on the first bodies of k contacts, the transmitted normal forces N, the new springs, who slides.

    `delta` overlap (m), `n` unit normals towards the first bodies, `v` relative velocities where they touch
    (m/s), `xi` springs (m), `R` and `m` effective radii (m) and masses (kg). A dashpot acts on the velocity
    at the middle of the step, which its own force changes: hence the factors 1 / (1 + c).
    """
    S_n, S_t = 2 * law.E * np.sqrt(R * delta), 8 * law.G * np.sqrt(R * delta)
    gamma_n, gamma_t = (2 * np.sqrt(5 / 6) * law.beta * np.sqrt(S * m) for S in (S_n, S_t))
    c_n, c_t = gamma_n * dt / (2 * m), gamma_t * dt / (2 * 2 / 7 * m)
    v_n = np.einsum("ka,ka->k", v, n)
    v_t = v - v_n[:, None] * n
    elastic = 4 / 3 * law.E * np.sqrt(R) * delta**1.5
    F_n, N = (elastic - gamma_n * v_n) / (1 + c_n), elastic / (1 + c_n)
    xi = xi + v_t * dt
    xi = xi - np.einsum("ka,ka->k", xi, n)[:, None] * n
    xi, _ = shortened(xi, (1 + c_t) * law.mu_s * N / S_t)
    F_t = -(S_t[:, None] * xi + gamma_t[:, None] * v_t) / (1 + c_t)[:, None]
    F_t, slides = shortened(F_t, law.mu_s * N)
    return F_n[:, None] * n + F_t, N, xi, slides


def rolling_torque(size, omega, n):
    """Torques of a `size` (N m) against the spins `omega`, without their parts along `n`."""
    spin = np.linalg.norm(omega, axis=1)
    torque = -np.divide(size, spin, out=np.zeros_like(spin), where=spin > 0)[:, None] * omega
    return torque - np.einsum("ka,ka->k", torque, n)[:, None] * n


def shortened(vectors, longest):
    """Vectors cut to given lengths, and which were cut."""
    length = np.linalg.norm(vectors, axis=1)
    cut = length > longest
    return vectors * np.where(cut, longest / np.where(cut, length, 1.0), 1.0)[:, None], cut
