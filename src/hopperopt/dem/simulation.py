"""A simulation in Python's hands: the arrays of a run and the calls into the compiled code."""

import math

import numba
import numpy as np

from hopperopt.dem import observe
from hopperopt.dem.contacts import BLOCK
from hopperopt.dem.state import (
    CHUNKS,
    COUNT,
    COUNTERS,
    NEEDED,
    OPENED,
    OVERLAP,
    PAIR_CARRIED,
    ROLLING,
    SPEED,
    STALE,
    STEP,
    TOUCH_CARRIED,
    Law,
    Laws,
    Settings,
    grown,
    make_chunks,
    make_pairs,
    make_spheres,
    make_touches,
)
from hopperopt.dem.step import (
    DONE,
    NOT_FINITE,
    NOTHING_CARRIED,
    PAIRS_FULL,
    advance,
    advance_threaded,
    collect_overlaps,
)
from hopperopt.dem.walls import make_walls, open_wall

HORIZON_STEPS = 30  # a moving sphere's skin lasts about this many steps
SKIN = 0.08  # skin of a resting sphere over the largest radius
SKIN_LIMIT = 0.75  # largest skin over the largest radius


class NotFinite(ArithmeticError):
    """A position is no longer a number, or ran away: the run has blown up."""


class Simulation:
    """Spheres, walls and laws, advanced step by step.

    Arguments: `position`, `velocity`, `spin` (n, 3) in m, m/s, rad/s; `radius` (n,) m; `density` kg/m3;
    `walls`, a dict of name -> (points, 2) revolved profile in m; `pair_law` and `wall_law` from
    `materials.contact_law`; `time_step` s; `gravity` m/s2, downward or a (3,) vector; `rolling` "edem", "cdt"
    or "none"; `threads` to work with, which changes nothing but the speed.
    """

    def __init__(
        self, position, velocity, radius, density, walls, pair_law, wall_law, time_step,
        gravity=9.81, rolling="edem", spin=None, threads=1,
    ):  # fmt: skip
        self.spheres = make_spheres(position, velocity, radius, density, spin)
        n = len(self.spheres.radius)
        self.walls = make_walls(list(walls.values()))
        self.wall_names = list(walls)
        self.pairs = make_pairs(n, 4 * n + 64)
        self.touches = make_touches(n, n // 4 + 64)
        self.chunks = make_chunks(len(walls), BLOCK)
        self.threads = threads
        self.exit_time = np.full(n, np.nan)  # by identity, s
        self.counters = np.zeros(len(COUNTERS), np.int64)
        self.counters[COUNT] = n
        self.counters[STALE] = 1
        self.counters[[PAIR_CARRIED, TOUCH_CARRIED]] = NOTHING_CARRIED
        self.monitors = np.zeros(2)
        collect_overlaps(self.chunks, self.monitors)
        self.laws = Laws(pair_law, wall_law)
        largest = float(self.spheres.radius.max())
        gravity = np.asarray(gravity, dtype=np.float64)
        gravity = gravity if gravity.shape == (3,) else np.array([0.0, 0.0, -float(gravity)])
        # Half a step after the velocities, at the time of the positions: a start from rest falls, too.
        speed2 = ((self.spheres.velocity + 0.5 * time_step * gravity) ** 2).sum(axis=1)
        self.settings = Settings(
            time_step=float(time_step),
            gravity=gravity,
            rolling=ROLLING[rolling],
            skin=SKIN * largest,
            horizon=HORIZON_STEPS * float(time_step),
            skin_limit=SKIN_LIMIT * largest,
            sensor=-math.inf,
            start_speed2=float(speed2.max()),
            highest=float(self.spheres.position[:, 2].max()),
        )

    @property
    def count(self):
        """Spheres that have not left."""
        return int(np.count_nonzero(np.isnan(self.exit_time)))

    @property
    def steps(self):
        """Steps done since the start, or since the clock was set back."""
        return int(self.counters[STEP] - self.counters[OPENED])

    @property
    def time(self):
        """Simulated time of those steps, s."""
        return self.steps * self.settings.time_step

    @property
    def rows(self):
        """Rows of the spheres arrays that are in use (spheres that left since the last rebuild included)."""
        return int(self.counters[COUNT])

    @property
    def max_overlap(self):
        """Largest overlap over the smaller radius so far."""
        return float(self.monitors[OVERLAP])

    @property
    def max_speed_ratio(self):
        """Largest speed so far over sqrt(v0^2 + 2 g (highest start - z))."""
        return math.sqrt(float(self.monitors[SPEED]))

    def advance(self, steps):
        """Run `steps` steps. Raises NotFinite when the run has blown up."""
        run = advance
        if self.threads > 1:
            run = advance_threaded
            numba.set_num_threads(min(self.threads, numba.config.NUMBA_NUM_THREADS))
        while steps > 0:
            outcome, done = run(
                self.spheres, self.pairs, self.touches, self.walls, self.chunks, self.exit_time,
                self.counters, self.monitors, self.laws, self.settings, steps,
            )  # fmt: skip
            collect_overlaps(self.chunks, self.monitors)
            steps -= done
            if outcome == NOT_FINITE:
                raise NotFinite(f"a sphere's position is not finite after {self.steps} steps")
            if outcome != DONE:
                capacity = int(1.25 * self.counters[NEEDED]) + 64
                if outcome == PAIRS_FULL:
                    self.pairs = grown(self.pairs, capacity)
                else:
                    self.touches = grown(self.touches, capacity)

    def open(self, wall, sensor):
        """Take a wall away at once, put the sensor plane at height `sensor` (m) and start the clock anew."""
        open_wall(self.walls, self.touches, self.touches.start[self.rows], self.wall_names.index(wall))
        self.settings = self.settings._replace(sensor=float(sensor))
        self.counters[OPENED] = self.counters[STEP]

    def by_identity(self, values):
        """Rows of a spheres array put under the identities; NaN for what has left. (n,) or (n, 3)."""
        inside = np.isnan(self.exit_time)
        ids = self.spheres.identity[: self.rows]
        out = np.full((len(self.exit_time), *values.shape[1:]), np.nan)
        out[ids] = values[: self.rows]
        out[~inside] = np.nan
        return out

    def touching(self):
        """Entries of the pair list that were in contact in the last step, (m,) int."""
        return np.flatnonzero(self.pairs.touched[: self.pairs.start[self.rows]] == self.counters[STEP] - 1)

    def contacts(self):
        """Number of contacts of each sphere in the last step, by identity, (n,) int."""
        rows, spheres, pairs = self.rows, self.spheres, self.pairs
        entries = self.touching()
        held = np.flatnonzero(self.touches.element[: self.touches.start[rows]] >= 0)
        at_wall = np.searchsorted(self.touches.start[: rows + 1], held, side="right") - 1
        touching = np.concatenate([pairs.owner[entries], pairs.partner[entries], at_wall])
        return np.bincount(spheres.identity[touching], minlength=len(self.exit_time))

    def wall_force(self, wall):
        """Force of the spheres on a wall in the last step, (3,) N."""
        return self.chunks.wall_force[: self.counters[CHUNKS], self.wall_names.index(wall)].sum(axis=0)

    def energy(self):
        """Kinetic, gravitational and elastic energy (J), all at the middle of the last step."""
        return observe.energies(
            self.spheres, self.pairs, self.touches, self.walls, self.counters, self.laws, self.settings
        )


def compile_solver(threads=1):
    """Compile (or load from the cache) all that a run on so many threads calls."""
    law = Law(1.0e6, 1.0e6, 0.5, 0.5, 0.05)
    simulation = Simulation(
        [[0.0, 0.0, 0.0009]],
        np.zeros((1, 3)),
        [0.001],
        1000.0,
        {"floor": [[0, 0], [1, 0]]},
        law,
        law,
        1e-6,
        threads=threads,
    )
    simulation.advance(1)
    simulation.energy()
