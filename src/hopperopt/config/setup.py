"""What one simulation needs: particles, materials, contacts, filling, discharge; the case that follows."""

import math
from functools import cached_property
from typing import Annotated, Literal

from pydantic import AfterValidator, ValidationError

from hopperopt import case as cases
from hopperopt import findings, geometry
from hopperopt.config.fields import (
    MM,
    Density,
    Friction,
    Length,
    Model,
    Number,
    Poisson,
    Seconds,
    Seed,
    Share,
    Speed,
)
from hopperopt.config.shapes import Hopper, Insert
from hopperopt.document import ConfigError, NotAllowed, replaced
from hopperopt.mistakes import sentences

CLEARANCE = 0.005  # m between what is below and the column of falling particles
RAYLEIGH_SHARE = 0.2  # of `time_step_s: auto`


def _ascending(diameters):
    if len(diameters) != 3 or list(diameters) != sorted(diameters):
        raise NotAllowed("three diameters, ascending or equal (fine, intermediate, coarse)")
    return diameters


class Particles(Model):
    """Spheres: equal numbers of three diameters, one material."""

    diameters_mm: Annotated[tuple[Length, ...], AfterValidator(_ascending)] = (2.0, 3.0, 4.0)
    """Fine, intermediate and coarse diameter, ascending or equal; equal numbers of each."""
    density_kg_m3: Density = 2285.0
    """Density of the spheres."""
    shear_modulus_pa: Annotated[float, Number(least=1000, most=1e13)] = 1.0e7
    """Shear modulus of the spheres."""
    poisson_ratio: Poisson = 0.25
    """Poisson's ratio of the spheres."""

    @property
    def diameters(self):
        """Fine, intermediate, coarse (m)."""
        return [diameter / MM for diameter in self.diameters_mm]

    @property
    def rayleigh_time(self):
        """Rayleigh time (s) of the smallest sphere, pi R sqrt(rho/G) / (0.1631 nu + 0.8766)."""
        wave = math.sqrt(self.density_kg_m3 / self.shear_modulus_pa) / (0.1631 * self.poisson_ratio + 0.8766)
        return math.pi * self.diameters[0] / 2 * wave


class Wall(Model):
    """Material of hopper, gate and insert; an infinite modulus is a rigid wall."""

    shear_modulus_pa: Annotated[float, Number(least=1000, most=1e13, infinite=True)] = 2.2e7
    """Shear modulus of the wall, at most 1e13; `.inf` is a rigid one."""
    poisson_ratio: Poisson = 0.25
    """Poisson's ratio of the wall."""


class ParticleContact(Model):
    """Particle against particle."""

    static_friction: Friction = 0.5
    """Coefficient of friction between particles."""
    rolling_friction: Friction = 0.05
    """Coefficient of rolling friction between particles."""
    restitution: Share = 0.7
    """Coefficient of restitution between particles."""


class WallContact(Model):
    """Particle against hopper, gate and insert."""

    static_friction: Friction = 0.5
    """Coefficient of friction with the wall."""
    rolling_friction: Friction = 0.25
    """Coefficient of rolling friction on the wall."""
    restitution: Share = 0.2
    """Coefficient of restitution at the wall."""


class Contact(Model):
    """The contact law's numbers; `rolling` names the model of rolling friction."""

    rolling: Literal["edem", "cdt", "none"] = "edem"
    """Model of rolling friction: EDEM's constant torque, LIGGGHTS' `cdt`, or none."""
    particle: ParticleContact = ParticleContact()
    wall: WallContact = WallContact()


def _thirds(count):
    if count is not None and count % 3:
        raise NotAllowed("null or a multiple of 3 (equal numbers of the three sizes)")
    return count


class Filling(Model):
    """How the hopper is filled: up to a level, or with a fixed number of particles."""

    level_mm: Length = 74.0
    """Height of the settled bed's surface above the outlet; sets the number of particles."""
    particles: Annotated[
        int | None, Number(least=3, most=findings.MOST_PARTICLES), AfterValidator(_thirds)
    ] = None
    """Number of particles, a multiple of 3, in the level's place; null goes by the level."""
    bed_solid_fraction: Annotated[float, Number(above=0, most=0.74)] = 0.55
    """Solid fraction of the settled bed, from which the number follows."""
    column_solid_fraction: Annotated[float, Number(above=0, most=0.3)] = 0.2
    """Solid fraction of the falling column at the start."""
    speed_m_s: Speed = 0.5
    """Downward speed of the column at the start."""
    speed_scatter_m_s: Speed = 0.05
    """Standard deviation of each component of the particles' speed at the start."""
    settling_limit_s: Seconds = 1.5
    """When the outlet opens at the latest; a bed that still moves marks the run as unsettled."""


class Discharge(Model):
    """How the discharge is measured, and what becomes of one that does not end."""

    sensor_mm: Annotated[float, Number(least=-100_000, below=0)] = -12.0
    """Height, below the outlet, of the plane where a particle counts as out."""
    idle_limit_s: Seconds = 0.5
    """The run ends when nothing has left for so long."""
    time_limit_s: Seconds = 10.0
    """The run ends so long after the opening at the latest."""
    incomplete: Literal["refuse", "drop"] = "refuse"
    """What becomes of runs that jammed or did not end well: they stop the study, or are dropped from it."""


class Simulation(Model):
    """Time step (`auto`: a fifth of the Rayleigh time), gravity; threads, checkpoints, snapshots of a run."""

    time_step_s: Annotated[float | Literal["auto"], Number(above=0)] = 4.0e-5
    """Time step; `auto` is a fifth of the smallest sphere's Rayleigh time."""
    gravity_m_s2: Annotated[float, Number(least=0.001, most=1000)] = 9.81
    """Acceleration of gravity."""
    threads: Annotated[int, Number(least=1, most=1024)] = 1
    """Threads of one simulation, which change its speed and nothing else; they pay from about 10,000
    particles on."""
    checkpoint_minutes: Annotated[float | None, Number(above=0, most=100_000)] = 5.0
    """How often a running simulation saves its state, to go on from when interrupted; null is never."""
    snapshot_interval_s: Annotated[float | None, Number(least=0.01, most=10_000)] = None
    """Interval of the positions and speeds that a run's file keeps for movies; null keeps none. At 0.02 s
    they take some 20 MB a run."""


class Setup(Model):
    """All that one simulation needs."""

    seed: Seed = 1
    """Seed of all fillings; each run's own follows from it, the run's name and its replicate."""
    hopper: Hopper = Hopper()
    insert: Insert = Insert()
    particles: Particles = Particles()
    wall: Wall = Wall()
    contact: Contact = Contact()
    filling: Filling = Filling()
    discharge: Discharge = Discharge()
    simulation: Simulation = Simulation()

    @cached_property
    def document(self):
        """The models as plain nested dicts."""
        return self.model_dump()

    def with_values(self, values):
        """The same with other values at dotted keys that exist; ConfigError when one is not allowed."""
        # The sections as they are, which need no second reading; those with other values as plain dicts.
        changed = {key.partition(".")[0] for key in values}
        document = {
            name: self.document[name] if name in changed else getattr(self, name)
            for name in type(self).model_fields
        }
        for key, value in values.items():
            document = replaced(document, key, value)
        try:
            return type(self).model_validate(document)
        except ValidationError as error:
            raise ConfigError("\n".join(sentences(error.errors(include_url=False), type(self)))) from None

    @cached_property
    def insert_profile(self):
        """The insert's polyline (m), None without one."""
        return self.insert.polyline()

    @cached_property
    def wall_gap(self):
        """Shortest distance (m) between insert and hopper: 0 for one that is not inside, infinite without."""
        if self.insert_profile is None:
            return math.inf
        vessel = self.hopper.profile(self.column_bottom)
        inside = geometry.stays_inside(self.insert_profile, vessel)
        return geometry.gap(self.insert_profile, vessel) if inside else 0.0

    @property
    def column_bottom(self):
        """Height (m) above which the particles start to fall: clear of bed, insert and the hopper's cone."""
        apex = 0.0 if self.insert_profile is None else self.insert_profile[:, 1].max()
        return max(self.filling.level_mm / MM, self.hopper.cone_top, apex) + CLEARANCE

    @property
    def particle_count(self):
        """The fixed number, or what fills the hopper around its insert up to the level."""
        if self.filling.particles is not None:
            return self.filling.particles
        return self.particles_up_to(self.filling.level_mm / MM)

    def particles_up_to(self, level):
        """Number of particles that fill the hopper around its insert up to a level (m)."""
        volume = geometry.volume_inside(self.hopper.profile(level), level)
        if self.insert_profile is not None:
            volume -= geometry.solid_volume(self.insert_profile, level)
        return geometry.particle_count(self.filling.bed_solid_fraction, volume, self.particles.diameters)

    @property
    def time_step(self):
        """Time step (s)."""
        step = self.simulation.time_step_s
        return float(f"{RAYLEIGH_SHARE * self.particles.rayleigh_time:.6g}") if step == "auto" else step

    def case(self, labels, seed):
        """One simulation as plain JSON values in SI; ConfigError where it cannot be simulated."""
        if refusals := findings.refusals(self):
            raise ConfigError("\n".join(refusals))
        return cases.simulation(self, labels, seed)


def derived_case(params, design):
    """The case of a design that the study found (see Study.derived_params); ConfigError if it is refused."""
    setup = Setup.model_validate(params["setup"]).with_values(
        {params["keys"][name]: value for name, value in design.items()}
    )
    return setup.case(design, params["seed"])
