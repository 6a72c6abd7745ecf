"""Random configuration documents, sound and spoilt, and what must hold for each of them.

A document is either refused, by sentences that each name a key of it, or everything that the workflow makes
of it can be made: warnings, the stages' settings, and a run of few particles that `gather` takes or refuses
by its status.
"""

import copy
import datetime
import json
import math
import tempfile
from collections import Counter
from pathlib import Path

import hypothesis
import pandas as pd
from hypothesis import strategies as st

from hopperopt import config, dataset, document, experiment, files
from hopperopt.config.stages import STAGES

PARTICLES, STEPS = 36, 10_000  # of a run, STEPS before and after the opening
FINEST_STEP = 2e-7  # s; a run with a finer step is not made
TOP = tuple(config.Study.model_fields)
KEYS = tuple(document.dotted_keys(config.parse({}).document))
SECTIONS = tuple(sorted({key.rpartition(".")[0] for key in KEYS} - {""}))
NASTY = (
    *(math.nan, math.inf, -math.inf, None, True, False, 0, -1, 1e300, -1e300, 1e-320, 0.001, 10**9, 10**30),
    *("", " ", "yes", "1_000", "010", "5e-4", "22,5", "12 mm", ".inf", "9" * 400, "a\nb", "\ud800", "\0"),
    *([], {}, [[]], [1, 2], [math.nan] * 3, ["x"] * 5, {"a": 1}, {1: 2}, {"a": {"b": {"c": []}}}, [3] * 2000),
    *(datetime.date(2024, 1, 1), b"bytes", {1, 2}, ((1, 2), (3, 4)), [{"key": "insert.height_mm"}]),
)
STRANGE = ("lenght_mm", "", " ", "a b", "a\nb", "[key]", "1", "é", "x" * 100, 1, 1.5, None, True, (1, 2))


def number(low, high):
    """A number as it may be typed: as one, or as text."""
    numbers = st.floats(low, high)
    return st.one_of(numbers, numbers, numbers.map(repr))


def whole(low, high):
    """A whole number as it may be typed."""
    numbers = st.integers(low, high)
    return st.one_of(numbers, numbers.map(float), numbers.map(str))


def some(**keys):
    """A section with any of its keys."""
    return st.fixed_dictionaries({}, optional=keys)


def _contact():
    return some(static_friction=number(0, 2), rolling_friction=number(0, 1), restitution=number(0, 1))


def _factor(key, low, high, count):
    levels = st.lists(st.floats(low, high), min_size=count, max_size=count, unique=True)
    return st.fixed_dictionaries({"key": st.just(key), "levels": levels})


# Factors that vary an insert of each shape, with a key and its range.
SHAPES = {
    "cone": {
        "theta_deg": ("insert.cone.slope_deg", 50.0, 60.0),
        "length_mm": ("insert.cone.length_mm", 20.0, 40.0),
    },
    "double_cone": {"lower_slope_deg": ("insert.double_cone.lower_slope_deg", 20.0, 60.0)},
    "bullet": {"radius_mm": ("insert.bullet.radius_mm", 10.0, 25.0)},
    "cone_in_cone": {"opening_radius_mm": ("insert.cone_in_cone.opening_radius_mm", 8.0, 16.0)},
    "profile": {},
    "none": {},
}


def _factors(shape, count):
    height = {} if shape == "none" else {"height_mm": _factor("insert.height_mm", 30.0, 34.0, count)}
    friction = {"friction": _factor("contact.particle.static_friction", 0.0, 2.0, count)}
    others = {name: _factor(*key, count) for name, key in SHAPES[shape].items()}
    return st.fixed_dictionaries(height or friction, optional=others | (friction if height else {}))


CASES = ("selected", "plan_best", "plan_centre", "bare")
BODY = "body.csv"
ANY = st.lists(st.tuples(number(0, 20), number(0, 30)).map(list), min_size=2, max_size=6)
OFF_AXIS = st.lists(st.tuples(number(0.5, 20), number(0, 30)).map(list), min_size=2, max_size=6)
RISING = OFF_AXIS.map(lambda points: sorted(points, key=lambda point: float(point[1])))
SOLID = RISING.map(lambda points: [[0, -1], *points, [0, 31]])
PROFILE = st.one_of(
    *(st.fixed_dictionaries({"points_mm": points}) for points in (RISING, SOLID, SOLID)),
    some(points_mm=ANY, file=st.sampled_from([BODY, "missing.csv"])),
    st.just({"file": BODY}),
)
SLOPE = number(1, 89)
SOUND = {
    "seed": whole(0, 2**62),
    "results_dir": st.sampled_from(["results", "a/b", "/nowhere/x", " spaced "]),
    "hopper": some(
        outlet_radius_mm=number(8, 30), half_angle_deg=number(15, 90), cylinder_radius_mm=number(40, 80)
    ),
    "insert": some(
        height_mm=number(25, 80),
        cone=some(slope_deg=SLOPE, length_mm=number(2, 40)),
        double_cone=some(lower_slope_deg=SLOPE, upper_slope_deg=SLOPE, length_mm=number(2, 40)),
        bullet=some(radius_mm=number(1, 25), cylinder_length_mm=number(0.1, 30), nose_slope_deg=SLOPE),
        cone_in_cone=some(
            slope_deg=SLOPE,
            length_mm=number(2, 40),
            opening_radius_mm=number(3, 20),
            thickness_mm=number(1, 4),
        ),
        profile=PROFILE,
    ),
    "particles": some(
        diameters_mm=st.lists(number(1.5, 5), min_size=3, max_size=3).map(lambda d: sorted(d, key=float)),
        density_kg_m3=number(500, 8000),
        shear_modulus_pa=number(1e6, 1e8),
        poisson_ratio=number(0, 0.5),
    ),
    "wall": some(
        shear_modulus_pa=st.one_of(number(1e6, 1e11), st.just(math.inf)), poisson_ratio=number(0, 0.5)
    ),
    "contact": some(rolling=st.sampled_from(["edem", "cdt", "none"]), particle=_contact(), wall=_contact()),
    "filling": some(
        level_mm=number(5, 120),
        particles=st.one_of(st.none(), whole(1, 1000).map(lambda count: 3 * int(float(count)))),
        bed_solid_fraction=number(0.4, 0.7),
        column_solid_fraction=number(0.02, 0.3),
        speed_m_s=number(0, 2),
        speed_scatter_m_s=number(0, 0.5),
        settling_limit_s=number(0.01, 5),
    ),
    "discharge": some(
        sensor_mm=number(-50, -1),
        idle_limit_s=number(0.01, 1),
        time_limit_s=number(0.01, 20),
        incomplete=st.sampled_from(["refuse", "drop"]),
    ),
    "simulation": some(
        time_step_s=st.one_of(st.just("auto"), number(1e-6, 5e-5)),
        gravity_m_s2=number(1, 20),
        threads=whole(1, 8),
    ),
    "surrogate": some(
        model=st.sampled_from(["auto", "paper", "network", "ensemble", "gaussian"]),
        starts=whole(1, 100),
        selected_hidden_nodes=st.sampled_from([3, 7, "auto"]),
        validation=some(starts=whole(1, 100)),
    ),
    "optimise": some(population=whole(4, 200), generations=whole(1, 100)),
    "verification": some(
        replicates=whole(1, 100),
        replicates_of=some(selected=whole(1, 100), bare=whole(1, 100)),
        cases=some(paper=st.none(), best_f=st.sampled_from(["best_f", None]), again=st.sampled_from(CASES)),
    ),
    "figures": some(dpi=whole(50, 600)),
}


def _plan(shape):
    """A plan of an insert's shape: the default one, of the cone's factors, or another."""
    arrays = st.fixed_dictionaries({"factors": _factors(shape, 5)})
    spread = st.fixed_dictionaries(
        {
            "design": st.fixed_dictionaries(
                {"plan": st.sampled_from(["lhs", "sobol"])}, optional={"replicates": whole(1, 20)}
            ),
            "factors": _factors(shape, 3),
        }
    )
    return st.one_of(arrays, spread, *([st.just({})] if shape == "cone" else []))


@st.composite
def documents(draw):
    """A document: some sections, each with some keys; half of them then spoilt in one to three places."""
    shape = draw(st.sampled_from([*SHAPES]))
    made = copy.deepcopy({**draw(some(**SOUND)), **draw(_plan(shape))})
    if shape != "cone":  # the default
        made["insert"] = {"profile": draw(PROFILE), **made.get("insert", {}), "shape": shape}
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 2, 3]))):
        _spoil(draw, made)
    return made


def _spoil(draw, made):
    """Give one key, known or not, a value that is mostly none of its own."""
    section = draw(st.sampled_from(SECTIONS))
    place = draw(
        st.one_of(
            st.sampled_from(KEYS).map(lambda key: key.split(".")),
            st.sampled_from(TOP).map(lambda key: [key]),
            st.sampled_from(STRANGE).map(lambda key: [*section.split("."), key]),
            st.sampled_from(STRANGE).map(lambda key: [key]),
        )
    )
    *above, last = place
    for key in above:
        below = made.get(key)
        made[key] = below if isinstance(below, dict) else {}
        made = made[key]
    made[last] = draw(st.sampled_from(NASTY))


def outcomes(count, seed):
    """How often each (outcome, shape of the insert) was that of `count` random documents; same for a seed."""
    found = Counter()

    @hypothesis.seed(seed)
    @hypothesis.settings(max_examples=count, deadline=None, database=None)
    @hypothesis.given(documents())
    def check(raw):
        found[outcome(raw)] += 1

    check()
    return found


def outcome(raw):
    """What becomes of a document, and the shape of its insert (None where it is refused).

    "refused", "accepted" (its step is too fine to run) or the run's status. Raises AssertionError, or
    whatever the package raises in place of a sentence, where something is wrong.
    """
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, BODY).write_text("r_mm,z_mm\n0,0\n10,0\n10,5\n0,20\n")
        try:
            study = config.parse(copy.deepcopy(raw), folder)
        except config.ConfigError as error:
            for sentence in str(error).split("\n"):
                assert _names_a_key(sentence, raw), sentence
            return "refused", None
        assert all(warning.isprintable() for warning in study.warnings())
        for params in map(study.stage_params, STAGES):
            # Some hold a case, where a rigid wall has an infinite modulus.
            json.dumps(params, allow_nan="derived" in params)
        json.dumps(study.derived_params("selected", 1))
        small = _small(study)
        ended = "accepted" if small.time_step < FINEST_STEP else _run(small, Path(folder))
        return ended, study.insert.shape


def _names_a_key(sentence, raw):
    """Whether a sentence is one printable line that begins with a key of the document or the schema."""
    known = {*TOP, *map(str, raw), *map(document.shown, raw)}
    named = any(sentence.startswith((f"{key}: ", f"{key}.", f"{key} (")) for key in known)
    return sentence.isprintable() and named


def _small(study):
    """The study with few particles, and times of at most so many steps that are not too fine."""
    step = max(study.time_step, 0.1 * study.particles.rayleigh_time)
    limits = {
        "filling.settling_limit_s": study.filling.settling_limit_s,
        "discharge.time_limit_s": study.discharge.time_limit_s,
    }
    short = {key: min(limit, STEPS * step) for key, limit in limits.items()}
    return study.with_values({"filling.particles": PARTICLES, "simulation.time_step_s": step, **short})


def _run(study, folder):
    """Simulate the plan's first design; what `gather` makes of the run follows from its status alone."""
    name, design = study.experiments()[0]
    run = experiment.run(study.simulation_case(design, name, 1))
    status = run["status"].item()
    files.write_netcdf(run, folder / f"{name}_rep_1.nc")
    files.write_table(pd.DataFrame([{"experiment": name, **design}]), folder / "design.csv")
    taken = True
    try:
        dataset.gather(
            {"factors": list(design), "incomplete": "refuse"},
            [folder / "design.csv"],
            [folder / f"{name}_rep_1.nc"],
            folder / "dataset.nc",
            folder / "runs.csv",
            folder / "designs.csv",
        )
    except files.InputError as error:
        taken = False
        assert f"{name}_rep_1: {status}" in str(error), str(error)
    assert taken == (status == "complete"), status
    return status
