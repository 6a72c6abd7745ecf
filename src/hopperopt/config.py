"""The study's configuration: a document becomes frozen models, and these give each stage its plain values.

Millimetres and degrees in the document, SI in the case of a simulation. The models' defaults are the paper's
study. No other module imports pydantic.
"""

import hashlib
import json
import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    StringConstraints,
    ValidationError,
)
from pydantic_core import core_schema

from hopperopt import case as cases
from hopperopt import checks, findings, geometry
from hopperopt import design as plans
from hopperopt.document import (
    ConfigError,
    NotAllowed,
    load,
    mistake,
    odd_keys,
    read_text,
    replaced,
    without_nulls,
)
from hopperopt.mistakes import sentences
from hopperopt.quantity import Quantity

__all__ = ["ConfigError", "Setup", "Study", "derived_case", "load", "parse"]

MM = 1000.0  # millimetres in a metre; dividing by it rounds once, so that 22.5 mm is 0.0225 m
CLEARANCE = 0.005  # m between what is below and the column of falling particles
RAYLEIGH_SHARE = 0.2  # of `time_step_s: auto`


class Number(Quantity):
    """A quantity as an annotation: `Annotated[float | Literal["auto"], Number(above=0)]`."""

    def __get_pydantic_core_schema__(self, source, handler):
        """Read the number first; what pydantic then checks already has the annotated type."""
        kinds = [get_args(kind)[0] if get_args(kind) else kind for kind in get_args(source) or (source,)]
        words = [None if kind is type(None) else kind for kind in kinds if kind not in (int, float)]

        def read(value):
            return self.read(value, int in kinds, words)

        return core_schema.no_info_before_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, core, handler):
        """The annotated type with the bounds where it is a number."""
        made = handler(core)
        bounds = {
            "exclusiveMinimum": self.above,
            "minimum": self.least,
            "exclusiveMaximum": self.below,
            "maximum": self.most,
        }
        for kind in made.get("anyOf", [made]):
            if kind.get("type") in ("number", "integer"):
                kind |= {word: bound for word, bound in bounds.items() if bound is not None}
        return made


Seconds = Annotated[float, Number(above=0, most=10_000)]
Length = Annotated[float, Number(least=0.001, most=100_000)]  # from a micrometre
Coordinate = Annotated[float, Number(least=-100_000, most=100_000)]
Slope = Annotated[float, Number(least=1, most=89)]
Density = Annotated[float, Number(least=10, most=100_000)]
Speed = Annotated[float, Number(least=0, most=100)]
Friction = Annotated[float, Number(least=0, most=10)]
Share = Annotated[float, Number(least=0, most=1)]
Finite = Annotated[float, Number()]
Count = Annotated[int, Number(least=1, most=10_000)]
Nodes = Annotated[int, Number(least=1, most=200)]
Seed = Annotated[int, Number(least=0, most=2**63 - 1)]
Poisson = Annotated[float, Number(least=0, most=0.5)]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$")]


class Model(BaseModel):
    """A section: frozen, no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Hopper(Model):
    """A conical hopper below a cylinder."""

    outlet_radius_mm: Length = 22.5
    """Radius of the outlet."""
    half_angle_deg: Annotated[float, Number(least=1, most=90)] = 45.0
    """Angle of the cone's wall from the vertical; 90 is a flat bottom."""
    cylinder_radius_mm: Length = 50.0
    """Radius of the cylinder above the cone."""

    @property
    def _shape(self):
        return self.outlet_radius_mm / MM, self.half_angle_deg, self.cylinder_radius_mm / MM

    @property
    def cone_top(self):
        """Height of the cone's upper edge (m)."""
        return geometry.cone_height(*self._shape)

    def profile(self, top):
        """The wall from the outlet up to `top` (m)."""
        return geometry.hopper(*self._shape, max(top, self.cone_top))


class Cone(Model):
    """A solid cone, apex up: slope angle from the horizontal, length along the slope."""

    slope_deg: Slope = 55.0
    """Slope from the horizontal."""
    length_mm: Length = 40.0
    """Length along the slope, from the edge of the base to the apex."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.cone(self.slope_deg, self.length_mm / MM)


class DoubleCone(Model):
    """Two solid cones base to base: slope angles from the horizontal, length along the upper slope."""

    lower_slope_deg: Slope = 60.0
    """Slope of the lower cone, from the horizontal."""
    upper_slope_deg: Slope = 55.0
    """Slope of the upper cone, from the horizontal."""
    length_mm: Length = 30.0
    """Length along the upper cone's slope, which sets the radius of the common base."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.double_cone(self.lower_slope_deg, self.upper_slope_deg, self.length_mm / MM)


class Bullet(Model):
    """A solid cylinder below a conical nose."""

    radius_mm: Length = 20.0
    """Radius of the cylinder."""
    cylinder_length_mm: Length = 10.0
    """Height of the cylinder."""
    nose_slope_deg: Slope = 55.0
    """Slope of the nose, from the horizontal."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.bullet(self.radius_mm / MM, self.cylinder_length_mm / MM, self.nose_slope_deg)


class ConeInCone(Model):
    """A hollow cone, wide end up, open at both ends; its upper rim falls outwards: nothing rests on it."""

    slope_deg: Slope = 70.0
    """Slope of the inner face, from the horizontal."""
    length_mm: Length = 30.0
    """Length along the inner face."""
    opening_radius_mm: Length = 12.0
    """Radius of the opening at the bottom, inside."""
    thickness_mm: Length = 2.0
    """Thickness of the sheet."""

    def profile(self):
        """Profile above the insert's height (m)."""
        sizes = (self.length_mm, self.opening_radius_mm, self.thickness_mm)
        return geometry.cone_in_cone(self.slope_deg, *(size / MM for size in sizes))


class Profile(Model):
    """A body of one's own: points r, z (z from the insert's height), in a CSV file or typed in."""

    file: Annotated[str, StringConstraints(min_length=1)] | None = None
    """CSV file with the columns `r_mm` and `z_mm`, from one end of the line to the other; z from the
    insert's height. A line with both ends on the axis, or one that closes, is a solid body, any other a
    shell without thickness."""
    points_mm: Annotated[
        tuple[tuple[Coordinate, Coordinate], ...] | None, Field(min_length=2, max_length=1000)
    ] = None
    """The same points typed in, `[[r, z], ...]`."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.raised([[r / MM, z / MM] for r, z in self.points_mm], 0.0)


class Insert(Model):
    """The body in the hopper; `shape` picks one of the sections below it."""

    shape: Literal["cone", "double_cone", "bullet", "cone_in_cone", "profile", "none"] = "cone"
    """Which of the sections below counts; `none` is the bare hopper."""
    height_mm: Length = 29.6
    """Height of the insert's lowest point above the outlet."""
    cone: Cone = Cone()
    double_cone: DoubleCone = DoubleCone()
    bullet: Bullet = Bullet()
    cone_in_cone: ConeInCone = ConeInCone()
    profile: Profile = Profile()

    def polyline(self):
        """The insert's profile in its place (m), None for the bare hopper."""
        if self.shape == "none":
            return None
        return geometry.raised(getattr(self, self.shape).profile(), self.height_mm / MM)


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
    """Shear modulus of the wall; `.inf` is a rigid one."""
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
            raise ConfigError("\n".join(sentences(_errors(error), type(self)))) from None

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


class Factor(Model):
    """A number of the configuration that the designs vary, and its levels."""

    key: str
    """The number that the factor varies, by its dotted key: any of hopper, insert, particles (but the
    diameters), wall, contact, filling, discharge or simulation."""
    levels: Annotated[tuple[Finite, ...], Field(min_length=2, max_length=plans.MOST_EXPERIMENTS)]
    """Its levels, in the key's unit: five for `l25`; other plans and the optimiser use the smallest and
    largest."""


def _power_of_two(count):
    if count & (count - 1):
        raise NotAllowed("a power of two (others lose the balance of Sobol' points)")
    return count


class Hypercube(Model):
    """Latin hypercube within the ranges of the levels."""

    experiments: Annotated[int, Number(least=2, most=plans.MOST_EXPERIMENTS)] = 25
    """Number of experiments."""
    seed: Seed = 1
    """Seed of the plan."""


class Sobol(Model):
    """Sobol' points within the ranges of the levels."""

    experiments: Annotated[
        int, Number(least=2, most=plans.MOST_EXPERIMENTS), AfterValidator(_power_of_two)
    ] = 32
    """Number of experiments, a power of two."""
    seed: Seed = 1
    """Seed of the plan."""


class OwnPlan(Model):
    """A plan of one's own: a CSV file, read when the configuration is."""

    file: Annotated[str, StringConstraints(min_length=1)] = "plan.csv"
    """CSV file with a column `experiment` and one for each factor."""


class Design(Model):
    """Which designs are simulated, and how often."""

    plan: Literal["l25", "lhs", "sobol", "csv"] = "l25"
    """Orthogonal array of 25 experiments, Latin hypercube, Sobol' points, or a CSV file of one's own."""
    replicates: Count = 3
    """Independent fillings of each design."""
    lhs: Hypercube = Hypercube()
    sobol: Sobol = Sobol()
    csv: OwnPlan = OwnPlan()


class Infill(Model):
    """Designs that are simulated after the plan, where its surrogate expects most of them."""

    rounds: Annotated[int, Number(least=0, most=100)] = 0
    """Rounds; in each, designs are proposed from all that is simulated, and simulated as often as the
    plan's."""
    batch: Annotated[int, Number(least=1, most=100)] = 4
    """Designs of a round: the one selected from the front, and those of the largest expected improvement of
    its hypervolume."""


class Validation(Model):
    """The comparison of the surrogates, each experiment left out once."""

    starts: Count = 20
    """Initial weight sets for each size, in the comparison of the surrogates."""


PAPERS_NETWORK = {"selected_hidden_nodes": 7, "clip_sigma": 3.0}


class Surrogate(Model):
    """The surrogate: which model; filter, split, hidden sizes and starts of networks."""

    model: Literal["auto", "paper", "network", "ensemble", "gaussian"] = "auto"
    """By comparison at experiments not seen (`auto`), or the one that is named; `paper` is a network with 7
    hidden nodes on targets clipped at 3 standard deviations, whatever else is set."""
    clip_sigma: Annotated[float | None, Number(above=0)] = 3.0
    """Limit of the targets' filter in standard deviations; null for none."""
    hidden_nodes: Annotated[tuple[Nodes, ...], Field(min_length=1)] = (3, 4, 5, 6, 7, 8, 9, 10)
    """Numbers of hidden nodes of the networks that are trained."""
    starts: Count = 100
    """Initial weight sets for each of these sizes."""
    selected_hidden_nodes: Annotated[int | Literal["auto"], Number(least=1, most=200)] = "auto"
    """One of these sizes; `auto` chooses by cross-validation."""
    split: Literal["experiments", "points"] = "experiments"
    """Into training, validation and test: whole experiments, or points as the paper."""
    validation_experiments: Count = 4
    """Experiments that stop the training."""
    test_experiments: Count = 4
    """Experiments that choose nothing and tell the error."""
    validation: Validation = Validation()
    seed: Seed = 1
    """Seed of split and weights."""

    @property
    def networks(self):
        """Settings of the networks' training, as plain values; of the paper's where it is chosen."""
        names = {"hidden_nodes", "starts", "selected_hidden_nodes", "seed"}
        settings = self.model_dump(mode="json", include=names)
        if self.model == "paper":
            nodes = PAPERS_NETWORK["selected_hidden_nodes"]
            settings |= {"hidden_nodes": sorted({*self.hidden_nodes, nodes}), "selected_hidden_nodes": nodes}
        return settings

    @property
    def targets(self):
        """Settings of the targets, as plain values; the clip is the paper's where its network is chosen."""
        settings = self.model_dump(
            include={"clip_sigma", "split", "validation_experiments", "test_experiments", "seed"}
        )
        return settings | ({"clip_sigma": PAPERS_NETWORK["clip_sigma"]} if self.model == "paper" else {})


class Optimise(Model):
    """NSGA-II and the choice from its front."""

    population: Annotated[int, Number(least=4, most=10_000)] = 100
    """Designs in a generation of NSGA-II."""
    generations: Count = 30
    """Generations, the first one included."""
    crossover_probability: Share = 0.9
    """Probability of crossover."""
    mutation_probability: Share = 0.1
    """Probability of mutation of each variable."""
    seed: Seed = 1
    """Seed of the search."""
    seeds: Annotated[int, Number(least=1, most=100)] = 3
    """Searches, each from another seed (`seed` and the next ones); their fronts are joined."""
    select: Literal["knee", "compromise", "explicit"] = "knee"
    """The front's knee, its best compromise, or the design named below."""
    explicit: dict[Name, Finite] = {}
    """With `select: explicit`, a number for each factor, within its levels."""


PAPERS_OPTIMUM = {"theta_deg": 56.7, "length_mm": 32.4, "height_mm": 33.0}  # the optimum of Yu and Saxén
Derived = Literal["selected", "best_f", "best_i", "plan_best"]
Fixed = Literal["plan_centre", "bare"]
DERIVED: tuple[Derived, ...] = get_args(Derived)
FIXED: tuple[Fixed, ...] = get_args(Fixed)
MOST_CASES = 1000  # `verify` gets them in one argument, whose length the system limits


def _read_case(value):
    """A verification case: one of the words, or a number for each factor."""
    if isinstance(value, str) and value in (*DERIVED, *FIXED):
        return value
    allowed = f"{', '.join((*DERIVED, *FIXED))}, or a number for each factor"
    if not isinstance(value, dict) or not value:
        raise NotAllowed(allowed)
    try:
        return {str(name): Quantity().read(number) for name, number in value.items()}
    except NotAllowed:
        raise NotAllowed(allowed) from None


Case = Annotated[Literal[Derived, Fixed] | dict[str, float], BeforeValidator(_read_case)]


class Verification(Model):
    """The designs that are simulated anew, by name, and how often."""

    replicates: Count = 10
    """Fillings of each case."""
    replicates_of: dict[Name, Count] = {"selected": 20, "plan_best": 20}
    """Fillings of single cases that have another number, by name."""
    cases: Annotated[dict[Name, Case], Field(min_length=1, max_length=MOST_CASES)] = {
        **{word: word for word in DERIVED},
        "plan_centre": "plan_centre",
        "paper": PAPERS_OPTIMUM,
        "bare": "bare",
    }
    """The designs that are simulated anew, by name: a word (`selected`; the front's ends `best_f` and
    `best_i`; `plan_best`; `plan_centre`, the middle levels; `bare`, no insert), or a number for each
    factor."""

    @property
    def words(self):
        """What a case may be, beside a design."""
        return (*DERIVED, *FIXED)

    def replicates_in(self, name):
        """Number of runs of a case."""
        return self.replicates_of.get(name, self.replicates)


class Figures(Model):
    """How the figures are drawn."""

    dpi: Annotated[int, Number(least=50, most=1200)] = 200
    """Resolution of the PNG files, dots per inch."""


def _results_dir(value):
    if not value.strip() or set(value) & set("{}\\") or not value.isprintable():
        raise NotAllowed("the path of a folder, without braces or backslashes")
    return Path(value).as_posix()


def _paper_factors():
    return {
        "theta_deg": Factor(key="insert.cone.slope_deg", levels=(60, 57.5, 55, 52.5, 50)),
        "length_mm": Factor(key="insert.cone.length_mm", levels=(50, 45, 40, 35, 30)),
        "height_mm": Factor(key="insert.height_mm", levels=(34, 32, 29.6, 28, 26)),
    }


class Study(Setup):
    """The whole study."""

    results_dir: Annotated[str, AfterValidator(_results_dir)] = "results"
    """Folder of everything that the study writes."""
    factors: Annotated[dict[Name, Factor], Field(min_length=1)] = Field(default_factory=_paper_factors)
    """What the designs vary, by name."""
    design: Design = Design()
    infill: Infill = Infill()
    surrogate: Surrogate = Surrogate()
    optimise: Optimise = Optimise()
    verification: Verification = Verification()
    figures: Figures = Figures()
    _own_plan: list = PrivateAttr(default_factory=list)
    _unused_columns: list = PrivateAttr(default_factory=list)

    @property
    def state_dir(self):
        """Where the states of unfinished simulations are kept."""
        return f"{self.results_dir}/.state"

    @property
    def levels(self):
        """The levels of each factor, by name."""
        return {name: factor.levels for name, factor in self.factors.items()}

    @property
    def bounds(self):
        """Smallest and largest level of each factor, by name: lists, as plain JSON has them."""
        return {name: list(plans.bounds(levels)) for name, levels in self.levels.items()}

    def with_design(self, design):
        """The study at one design (factor values by name); raises ConfigError when a value is not allowed."""
        if unknown := [name for name in design if name not in self.factors]:
            raise ConfigError("\n".join(mistake("factor", name, ", ".join(self.factors)) for name in unknown))
        return self.with_values({self.factors[name].key: value for name, value in design.items()})

    def without_insert(self):
        """The study in the bare hopper."""
        return self.with_values({"insert.shape": "none"})

    @cached_property
    def plan(self):
        """The experiments (name, design, level numbers) of the plan."""
        match self.design.plan:
            case "l25":
                return plans.l25(self.levels)
            case "lhs":
                return plans.lhs(self.levels, self.design.lhs.experiments, self.design.lhs.seed)
            case "sobol":
                return plans.sobol(self.levels, self.design.sobol.experiments, self.design.sobol.seed)
            case "csv":
                return self._own_plan

    @property
    def unused_columns(self):
        """Columns of an own plan that are no factor's."""
        return self._unused_columns

    def experiments(self):
        """(name, design) of each experiment of the plan, in its order."""
        return [(experiment.name, experiment.design) for experiment in self.plan]

    def proposals(self):
        """Names of the designs of each round of infill, from the first on: a list for each."""
        infill = self.infill
        return [plans.proposals(number, infill.batch) for number in range(1, infill.rounds + 1)]

    def cases(self):
        """Verification cases by name: a word of DERIVED (to be found), a design, or None (no insert)."""
        meaning = {"plan_centre": plans.centre(self.levels), "bare": None}
        return {
            name: meaning.get(case, case) if isinstance(case, str) else case
            for name, case in self.verification.cases.items()
        }

    def simulation_case(self, design, name, replicate):
        """The case (plain JSON, SI) of one run of a design, None for the bare hopper.

        Its seed follows from the study's seed, the run's name and replicate alone.
        """
        setup = self.without_insert() if design is None else self.with_design(design)
        return setup.case(design or {}, run_seed(self.seed, name, replicate))

    def derived_params(self, name, replicate):
        """What `derived_case` needs, beside the design that is found later, for one run (plain JSON)."""
        centre = self.with_design(plans.centre(self.levels)).document
        setup = json.loads(json.dumps({key: centre[key] for key in Setup.model_fields if key != "seed"}))
        # Without what no case depends on, which would only rerun the simulation.
        used = ("shape",) if self.insert.shape == "none" else ("shape", "height_mm", self.insert.shape)
        setup["insert"] = {key: value for key, value in setup["insert"].items() if key in used}
        setup["discharge"].pop("incomplete")
        for unused in ("threads", "checkpoint_minutes"):
            setup["simulation"].pop(unused)
        if setup["simulation"]["snapshot_interval_s"] is None:  # as in the case
            setup["simulation"].pop("snapshot_interval_s")
        if setup["filling"]["particles"] is not None:
            setup["filling"].pop("bed_solid_fraction")
        keys = {name: factor.key for name, factor in self.factors.items()}
        return {"setup": setup, "keys": keys, "seed": run_seed(self.seed, name, replicate)}

    def warnings(self):
        """One sentence for each thing that is allowed but unusual."""
        return checks.warnings(self)

    def stage_params(self, stage):
        """The settings of one stage as plain JSON values; KeyError for an unknown stage."""
        return STAGES[stage](self)


# Lists keep the order of factors and cases, which the sorted keys of a job's JSON would not.
SHOWN = ("filter", "train", "validate", "choose", "optimise", "verify", "figures")  # in the report
STAGES = {
    "design": lambda study: {
        "factors": list(study.factors),
        "experiments": [experiment._asdict() for experiment in study.plan],
    },
    "gather": lambda study: {"factors": list(study.factors), "incomplete": study.discharge.incomplete},
    "effects": lambda study: {"factors": list(study.factors)},
    "filter": lambda study: {
        "factors": list(study.factors),
        **study.surrogate.targets,
    },
    "train": lambda study: study.surrogate.networks,
    "validate_fold": lambda study: study.surrogate.networks | {"starts": study.surrogate.validation.starts},
    "validate": lambda study: study.surrogate.networks | {"starts": study.surrogate.validation.starts},
    "choose": lambda study: {"model": study.surrogate.model, **study.surrogate.networks},
    "sensitivity": lambda study: {
        "bounds": study.bounds,
        "seed": study.surrogate.seed,
    },
    "optimise": lambda study: {
        **study.optimise.model_dump(exclude={"explicit"}),
        "explicit": study.optimise.explicit if study.optimise.select == "explicit" else None,
        "bounds": study.bounds,
        "centre": plans.centre(study.levels),
    },
    # Rounds of infill follow Gaussian processes, whatever surrogate the study goes on with: clip and split
    # are nothing to these.
    "infill_filter": lambda study: {
        "factors": list(study.factors),
        "clip_sigma": None,
        "split": "points",
        "validation_experiments": 1,
        "test_experiments": 1,
        "seed": study.surrogate.seed,
    },
    "infill_model": lambda study: {"model": "gaussian", "seed": study.surrogate.seed},
    "infill_front": lambda study: study.stage_params("optimise") | {"select": "knee", "explicit": None},
    "propose": lambda study: {
        "bounds": study.bounds,
        "replicates": study.design.replicates,
        "seed": study.optimise.seed,
        "derived": study.derived_params("propose", 1),
    },
    "verify": lambda study: {
        "cases": [
            [name, case if isinstance(case, str) else "design"]
            for name, case in study.verification.cases.items()
        ],
        "incomplete": study.discharge.incomplete,
        "seed": study.surrogate.seed,
    },
    "figures": lambda study: study.figures.model_dump(),
    "report": lambda study: {
        "cases": study.stage_params("verify")["cases"],
        "factors": list(study.factors),
        "derived": study.derived_params("report", 1),
        # Nothing that the files it is made of do not depend on.
        "settings": {stage: study.stage_params(stage) for stage in SHOWN},
    },
}


def run_seed(seed, name, replicate):
    """Seed (48 bits) of one run, from the study's seed, the run's name and its replicate's number."""
    digest = hashlib.sha256(json.dumps([seed, name, replicate]).encode()).digest()
    return int.from_bytes(digest[:6], "big")


def json_schema():
    """JSON schema of a document, an override included: no key is required, entries by name may be null."""
    made = Study.model_json_schema()
    for part in (made, *made["$defs"].values()):
        part.pop("required", None)
        for entries in part["properties"].values():
            entries.pop("title", None)
            if "description" in entries:
                entries["description"] = " ".join(entries["description"].split())
            if "$ref" in entries:
                entries.pop("default", None)
            for kind in ("patternProperties", "additionalProperties"):
                if isinstance(entries.get(kind), dict):
                    entries[kind] = _or_null(entries[kind], kind == "patternProperties")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **made}


def _or_null(entry, by_pattern):
    """The schema of an entry by name that null leaves out."""
    if by_pattern:
        return {pattern: _or_null(each, False) for pattern, each in entry.items()}
    return {"anyOf": [entry, {"type": "null"}]}


def derived_case(params, design):
    """The case of a design that the study found (see Study.derived_params); ConfigError if it is refused."""
    setup = Setup.model_validate(params["setup"]).with_values(
        {params["keys"][name]: value for name, value in design.items()}
    )
    return setup.case(design, params["seed"])


def parse(document, directory="."):
    """The study of a raw document; relative paths in it are relative to `directory`.

    Raises ConfigError with one line for each mistake: dotted key, value, and what is allowed.
    """
    if found := list(odd_keys(document)):
        raise ConfigError("\n".join(found))
    entries = ("factors", "optimise.explicit", "verification.cases", "verification.replicates_of")
    document = without_nulls(document, entries)
    study, found, faulty = _models(document)
    study = _with_its_cases(study)
    if not {"insert", "design", "factors"} & faulty:
        study, unread = _with_files(study, Path(directory))
        found += unread
        faulty |= {"insert", "design"} if unread else set()
    found += [*_results_folder(study, Path(directory)), *checks.mistakes(study, faulty)]
    if found:
        raise ConfigError("\n".join(found))
    return study


def _with_its_cases(study):
    """The study without the default case that is a design of the paper's, where its factors are others."""
    verification = study.verification
    if "cases" in verification.model_fields_set or set(study.factors) == set(PAPERS_OPTIMUM):
        return study
    cases = {name: case for name, case in verification.cases.items() if case != PAPERS_OPTIMUM}
    return study.model_copy(update={"verification": verification.model_copy(update={"cases": cases})})


def _errors(error):
    return error.errors(include_url=False)


def _models(document):
    """The study, the sentences for its mistakes, and the sections these spoil (there the defaults stand)."""
    try:
        return Study.model_validate(document), [], set()
    except ValidationError as error:
        errors = _errors(error)
    spoilt = {str(item["loc"][0]) for item in errors if item["loc"]}
    rest = {key: value for key, value in document.items() if key not in spoilt}
    return Study.model_validate(rest), sentences(errors, Study), spoilt


def _results_folder(study, directory):
    """The sentence for a `results_dir` that no folder can have."""
    path = directory / study.results_dir
    try:
        place = next((place for place in (path, *path.parents) if place.exists()), directory)
    except OSError as error:
        yield mistake("results_dir", study.results_dir, f"the path of a folder ({error.strerror})")
        return
    if not place.is_dir():
        yield mistake("results_dir", study.results_dir, f"the path of a folder ({place} is a file)")


def _with_files(study, directory):
    """The study with its CSV files read, and the sentences for those that cannot be used."""
    found, own = [], study.insert.profile
    if study.insert.shape == "profile" and (own.file is not None or own.points_mm is None):
        try:
            points = plans.points_from_csv("" if own.file is None else read_text(directory / own.file))
            study = study.with_values({"insert.profile.points_mm": points, "insert.profile.file": None})
        except NotAllowed as error:
            found.append(mistake("insert.profile.file", own.file, error))
        except ConfigError as error:
            found.append(f"{error} (from {own.file})")
    if study.design.plan == "csv":
        try:
            text = read_text(directory / study.design.csv.file)
            study._own_plan = plans.from_csv(text, study.levels)
            study._unused_columns = plans.unused_columns(text, study.levels)
        except NotAllowed as error:
            found.append(mistake("design.csv.file", study.design.csv.file, error))
    return study, found
