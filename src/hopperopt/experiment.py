"""One simulated experiment: fill, settle, open the gate, discharge; and the data set of what was seen.

A case is a plain dict in SI units (`config.Study.simulation_case` makes it).
"""

import logging
import time
from dataclasses import dataclass

import numpy as np
import xarray as xr

from hopperopt.dem import checkpoint as solver
from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import NotFinite, Simulation
from hopperopt.monitors import (
    MAX_ENERGY_GAIN,
    MAX_OVERLAP,
    MAX_SPEED_RATIO,
    EnergyWatch,
    Envelope,
    FlowPattern,
    filling_level,
)
from hopperopt.packing import scatter

SAMPLE_TIME = 0.01  # s between two looks at the state
SETTLED_TIME = 0.02  # s over which the centre of mass has come to rest
SETTLED_ENERGY = 1.0e-3  # of m g d, kinetic energy per particle
SETTLED_SINKING = 0.01  # coarse diameters
RESIDUAL_SHARE = 1.0e-3  # of the mass: what may stay in a hopper that counts as empty
RATE_SHARE = (0.2, 0.6)  # of the mass discharged, for the mean rate
PROGRESS_TIME = 1.0  # s between two reports
CLASSES = 3
# Every field of an experiment, beside those of its simulation, that the run changes.
EVOLVING = (
    "envelope.outside", "energy.least", "energy.gain", "flow.sums", "flow.counts", "flow.samples", "heights",
    "filling_time", "level", "settled", "finite", "position_opening", "position_half", "particle_steps",
    "step_count", "wall_time",
)  # fmt: skip


@dataclass
class Progress:
    """One report of a running simulation."""

    stage: str  # "filling", "settling" or "discharge"
    time: float  # s simulated in the filling or since the opening
    particles: int  # still in the hopper
    rate: float  # particle-steps per second
    remaining: float | None  # s of wall time to go, where it can be told


def run(case, progress=None, threads=1, checkpoint=None):
    """Simulate one experiment.

    Arguments: the case; `progress`, called with a `Progress` about once a second; `threads` to work with,
    which change no bit of what is simulated; `checkpoint`, which keeps the state of the run (arrays by name):
    `load()` returns what it has kept of this case or None, `due()` tells whether to `save(state)`. Nor does
    saving change a bit, or going on from a saved state. Returns the run's data set: exit times, diameters,
    size classes and two sets of positions by particle, and scalars (see `dataset`). A run that jams, ends at
    a limit or breaks a monitor returns as well: its `status` says so.
    """
    return _Experiment(case, progress, threads, checkpoint).run()


def build(case, threads=1):
    """The simulation of a case at its start: spheres scattered in the column, all walls closed."""
    generator = np.random.default_rng(case["seed"])
    particles, filling, contact = case["particles"], case["filling"], case["contact"]
    radius = 0.5 * np.repeat(particles["diameters"], particles["counts"])
    position = scatter(
        radius, filling["column_radius"], filling["column_bottom"], filling["solid_fraction"], generator
    )
    velocity = generator.normal(0.0, filling["speed_scatter"], position.shape)
    velocity[:, 2] -= filling["speed"]
    sphere = (particles["shear_modulus"], particles["poisson_ratio"])
    wall = (case["wall"]["shear_modulus"], case["wall"]["poisson_ratio"])
    pair, touch = contact["particle"], contact["wall"]
    return Simulation(
        position,
        velocity,
        radius,
        particles["density"],
        {name: np.array(points) for name, points in case["walls"].items() if points is not None},
        contact_law(sphere, sphere, pair["restitution"], pair["static_friction"], pair["rolling_friction"]),
        contact_law(sphere, wall, touch["restitution"], touch["static_friction"], touch["rolling_friction"]),
        case["time_step"],
        gravity=case["gravity"],
        rolling=contact["rolling"],
        threads=threads,
    )


class _Experiment:
    """The state of one run beyond the solver's: what has been observed so far."""

    def __init__(self, case, progress, threads, checkpoint):
        self.case = case
        self.progress = progress
        self.checkpoint = checkpoint
        self.simulation = build(case, threads)
        spheres = self.simulation.spheres
        order = np.argsort(spheres.identity)
        self.diameter = 2.0 * spheres.radius[order]
        self.mass = spheres.mass[order]
        self.size_class = np.repeat(np.arange(CLASSES, dtype=np.int8), case["particles"]["counts"])
        self.sample_steps = max(1, round(SAMPLE_TIME / case["time_step"]))
        self.envelope = Envelope(case["walls"]["hopper"], len(self.mass))
        self.flow = FlowPattern(case)
        self.energy = EnergyWatch(self.simulation.energy())
        self.particle_steps, self.step_count = 0, 0
        self.wall_time = 0.0  # s up to `clock`, which is read at every sample
        self.clock = self.reported = time.monotonic()
        nowhere = np.full((len(self.mass), 3), np.nan)
        self.position_opening, self.position_half = nowhere, nowhere
        self.heights = [self.height()]  # of the centre of mass at every sample of the filling, m
        self.level = self.filling_time = np.nan
        self.settled = self.finite = True

    def run(self):
        """Fill, open, discharge, or what is left of it after a checkpoint; return the data set."""
        if self.checkpoint is not None and (state := self.checkpoint.load()) is not None:
            self.restore(state)
        try:
            if np.isnan(self.filling_time):
                self.fill()
                self.simulation.open("gate", self.case["discharge"]["sensor"])
            self.discharge()
        except NotFinite:
            self.finite = False
        return self.dataset()

    def state(self):
        """All that the rest of the run depends on, arrays by name (no copies)."""
        return solver.read(self, EVOLVING) | solver.read(self.simulation, solver.EVOLVING)

    def restore(self, state):
        """Go on from a state of a run of the same case."""
        solver.restore(self.simulation, state)
        solver.write(self, EVOLVING, state)
        stage = "filling" if np.isnan(self.filling_time) else "discharge"
        logging.info(
            f"resumed from a checkpoint at {self.simulation.time:.3f} s of the {stage}, "
            f"{self.simulation.count} particles left"
        )

    def advance(self, stage):
        """Run up to the next sample and report; the state before is what a checkpoint keeps."""
        if self.checkpoint is not None and self.checkpoint.due():
            self.checkpoint.save(self.state())
        rows, begun = self.simulation.rows, time.monotonic()
        self.simulation.advance(self.sample_steps)
        self.step_count += self.sample_steps
        self.particle_steps += rows * self.sample_steps
        now = time.monotonic()
        self.wall_time += now - self.clock
        self.clock = now
        if self.progress is not None and now - self.reported >= PROGRESS_TIME:
            self.reported = now
            rate = rows * self.sample_steps / max(now - begun, 1e-9)
            self.progress(
                Progress(
                    stage, self.simulation.time, self.simulation.count, rate, self.remaining(stage, rate)
                )
            )

    def remaining(self, stage, rate):
        """Wall time (s) to the end of a discharge at the mean outflow so far; None before it can be told."""
        left, done = self.simulation.count, self.share_discharged()
        if stage != "discharge" or done < 0.02:
            return None
        steps = self.simulation.steps * (1.0 - done) / done
        return steps * 0.5 * left / rate

    def positions(self):
        """Positions by identity, (n, 3) m; NaN for what has left."""
        return self.simulation.by_identity(self.simulation.spheres.position)

    def share_discharged(self):
        """Mass fraction that has passed the sensor."""
        return float(self.mass[~np.isnan(self.simulation.exit_time)].sum() / self.mass.sum())

    def fill(self):
        """Rain and settle, until the bed is at rest or the time is over."""
        limit = self.case["filling"]["settling_limit"]
        while not self.at_rest():
            if self.simulation.time >= limit:
                self.settled = False
                break
            self.advance("settling" if self.simulation.time > 0.2 else "filling")
            self.heights.append(self.height())
            self.energy.sample(self.simulation.energy())
            self.envelope.sample(self.positions(), gate_closed=True)
        self.filling_time = self.simulation.time
        self.position_opening = self.positions()
        contacts = self.simulation.contacts()
        self.level = filling_level(self.position_opening, 0.5 * self.diameter, contacts, self.case)

    def height(self):
        """Height of the centre of mass, m."""
        # A sum and no product of vectors: BLAS shares a long one among the cores, and its bits with them.
        return float(np.sum(self.mass * self.positions()[:, 2]) / self.mass.sum())

    def at_rest(self):
        """Whether the kinetic energy is spent and the centre of mass has come to rest."""
        back = max(1, round(SETTLED_TIME / (self.sample_steps * self.case["time_step"])))
        if len(self.heights) <= back:
            return False
        kinetic = self.simulation.energy()[0] / len(self.mass)
        quiet = kinetic < SETTLED_ENERGY * self.mass.mean() * self.case["gravity"] * self.diameter.mean()
        sunk = self.heights[-1 - back] - self.heights[-1]
        return quiet and sunk < SETTLED_SINKING * self.diameter.max()

    def discharge(self):
        """Run with the gate open until the hopper is empty, idle or out of time."""
        limits, simulation = self.case["discharge"], self.simulation
        while simulation.count and simulation.time < limits["time_limit"]:
            last = np.nanmax(simulation.exit_time, initial=0.0)
            if simulation.time - last >= limits["idle_limit"]:
                break
            self.advance("discharge")
            share, position = self.share_discharged(), self.positions()
            self.envelope.sample(position, gate_closed=False)
            self.flow.sample(position, simulation.by_identity(simulation.spheres.velocity), share)
            if share >= 0.5 and np.isnan(self.position_half).all():
                self.position_half = position

    def status(self):
        """One word: what the run is worth as a data point. Only "complete" is one."""
        simulation = self.simulation
        if (
            not self.finite
            or self.envelope.lost
            or not simulation.max_overlap <= MAX_OVERLAP
            or not simulation.max_speed_ratio <= MAX_SPEED_RATIO
            or not self.energy.gain <= MAX_ENERGY_GAIN
        ):
            return "monitor"
        if not self.settled:
            return "unsettled"
        if 1.0 - self.share_discharged() <= RESIDUAL_SHARE:
            return "complete"
        return "incomplete" if simulation.time >= self.case["discharge"]["time_limit"] else "jammed"

    def discharge_rate(self):
        """Mean mass flow (kg/s) while the discharged share of the batch goes from 0.2 to 0.6; NaN if it does
        not, or within one step."""
        left = np.flatnonzero(~np.isnan(self.simulation.exit_time))
        times = self.simulation.exit_time[left]
        order = np.argsort(times, kind="stable")
        share = np.cumsum(self.mass[left][order]) / self.mass.sum()
        if not len(share) or share[-1] < RATE_SHARE[1]:
            return np.nan
        begin, end = np.interp(RATE_SHARE, share, times[order])
        if end - begin < self.case["time_step"]:  # a single layer that falls as one
            return np.nan
        return float((RATE_SHARE[1] - RATE_SHARE[0]) * self.mass.sum() / (end - begin))

    def dataset(self):
        """The run's data set, schema in `SCALARS` and `PARTICLES`."""
        simulation = self.simulation
        seconds = self.wall_time + time.monotonic() - self.clock
        left = np.isnan(simulation.exit_time)
        values = {
            "particle_count": len(self.mass),
            "filling_level": self.level,
            "settled": int(self.settled),
            "filling_time": self.filling_time,
            "discharge_time": float(np.nanmax(simulation.exit_time)) if not left.all() else np.nan,
            "discharge_rate": self.discharge_rate(),
            "mass_flow_index": self.flow.index,
            "residual_count": int(np.count_nonzero(left)),
            "residual_mass_fraction": 1.0 - self.share_discharged() if left.any() else 0.0,
            "max_overlap": simulation.max_overlap,
            "max_speed_ratio": simulation.max_speed_ratio,
            "max_energy_gain": self.energy.gain,
            "lost_particles": self.envelope.lost if self.finite else max(1, self.envelope.lost),
            "step_count": self.step_count,
            "status": self.status(),
        }
        arrays = {
            "exit_time": simulation.exit_time.copy(),
            "diameter": self.diameter,
            "size_class": self.size_class,
            "position_opening": self.position_opening.astype(np.float32),
            "position_half": self.position_half.astype(np.float32),
        }
        variables = {name: ((), values[name], attributes) for name, attributes in SCALARS.items()}
        for name, attributes in PARTICLES.items():
            dims = ("particle", "xyz")[: arrays[name].ndim]
            variables[name] = (dims, arrays[name], attributes)
        speed = {"wall_time_s": seconds, "particle_steps_per_s": self.particle_steps / seconds}
        return xr.Dataset(variables, coords={"xyz": ["x", "y", "z"]}, attrs=speed)


def _about(long_name, units="1"):
    return {"long_name": long_name, "units": units}


SCALARS = {
    "particle_count": _about("number of particles"),
    "filling_level": _about(
        "height of the settled bed's top above the outlet: mean over ten rings of the highest resting sphere",
        "m",
    ),
    "settled": _about("whether the bed came to rest before the opening (1) or not (0)"),
    "filling_time": _about("simulated time of filling and settling", "s"),
    "discharge_time": _about("time from the opening to the last exit", "s"),
    "discharge_rate": _about("mean mass flow while 20 to 60 % of the mass leave", "kg s-1"),
    "mass_flow_index": _about("downward speed at the wall over that at the axis"),
    "residual_count": _about("number of particles that stayed"),
    "residual_mass_fraction": _about("mass fraction that stayed"),
    "max_overlap": _about("largest overlap over the smaller radius"),
    "max_speed_ratio": _about(
        "largest speed, at the positions' time, over that of free fall from the highest start"
    ),
    "max_energy_gain": _about("largest gain of mechanical energy over the potential energy released"),
    "lost_particles": _about("number of particles seen outside the walls"),
    "step_count": _about("number of time steps"),
    "status": {"long_name": "complete, jammed, incomplete, unsettled or monitor (a monitor out of bounds)"},
}
PARTICLES = {
    "exit_time": _about("time from the opening to the passage of the sensor, missing for what stayed", "s"),
    "diameter": _about("particle diameter", "m"),
    "size_class": {
        "long_name": "size class",
        "flag_values": np.arange(CLASSES, dtype=np.int8),
        "flag_meanings": "fine intermediate coarse",
    },
    "position_opening": _about("position at the opening of the gate", "m"),
    "position_half": _about("position when half of the mass has left, missing for what left before", "m"),
}
