"""The shapes of inserts: their profiles, what the configuration refuses of them, and the shipped examples."""

import functools
import re
from pathlib import Path

import numpy as np
import pytest

from hopperopt import config, document, experiment, geometry
from hopperopt.config import ConfigError
from hopperopt.design import corners

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "config/examples").glob("*.yaml"))
PI = np.pi


def example(name, changes=()):
    """The study of a shipped example, changed in some keys."""
    shipped = config.load([ROOT / "config.yaml", ROOT / f"config/examples/{name}.yaml"])
    return config.parse(document.merge(shipped, dict(changes)), ROOT)


@functools.cache
def shipped_example(name):
    """The study of a shipped example."""
    return example(name)


def wall_ring(inner, outer, height):
    """Volume of a cylinder between two radii."""
    return PI * (outer**2 - inner**2) * height


def frustum(r1, r2, height):
    """Volume between two circles."""
    return PI * height / 3 * (r1 * r1 + r1 * r2 + r2 * r2)


def test_double_cone_is_two_cones_on_one_base():
    base = 0.04 * np.cos(np.radians(60))
    lower, upper = base * np.tan(np.radians(30)), 0.04 * np.sin(np.radians(60))
    profile = geometry.double_cone(30, 60, 0.04)
    assert profile == pytest.approx(np.array([[0, 0], [base, lower], [0, lower + upper]]))
    volume = frustum(0, base, lower) + frustum(base, 0, upper)
    assert geometry.solid_volume(profile, 1) == pytest.approx(volume, rel=1e-9)


def test_bullet_is_a_cylinder_below_a_cone():
    nose = 0.02 * np.tan(np.radians(40))
    profile = geometry.bullet(0.02, 0.01, 40)
    assert profile == pytest.approx(np.array([[0, 0], [0.02, 0], [0.02, 0.01], [0, 0.01 + nose]]))
    volume = wall_ring(0, 0.02, 0.01) + frustum(0.02, 0, nose)
    assert geometry.solid_volume(profile, 1) == pytest.approx(volume, rel=1e-9)


def test_cone_in_cone_is_a_sheet_of_its_thickness():
    profile = geometry.cone_in_cone(70, 0.03, 0.012, 0.002)
    slope = np.radians(70)
    assert profile[:, 1].min() == 0 and profile[:, 1].max() == pytest.approx(0.03 * np.sin(slope))
    assert geometry.opening_radius(profile) == geometry.inner_radius(profile) == 0.012
    inner, outer = profile[[0, 3]], profile[[1, 2]]
    assert np.linalg.norm(inner[1] - inner[0]) == pytest.approx(0.03)
    normal = np.array([np.sin(slope), -np.cos(slope)])
    assert (outer - inner[0]) @ normal == pytest.approx([0.002, 0.002], abs=1e-9)
    across, down = outer[1] - inner[1]
    assert across == pytest.approx(-down) and across > 0
    length, width = 0.03 * np.sin(slope), 0.002 / np.sin(slope)
    sheet = 2 * PI * length * width * (0.012 + length / np.tan(slope) / 2 + width / 2)
    assert sheet * 0.95 < geometry.solid_volume(profile, 1) < sheet


@pytest.mark.parametrize(
    ("profile", "slope"),
    [
        (geometry.cone(35, 0.04), 35),
        (geometry.cone(35, 0.04)[::-1], 35),
        (geometry.double_cone(20, 50, 0.04), 50),
        (geometry.bullet(0.02, 0.01, 40), 40),
        (geometry.cone_in_cone(70, 0.03, 0.012, 0.002), 45),
        (np.array([[0, 0], [2, 0], [2, 1], [1, 1], [0, 2.0]]), 0),
        (np.array([[1, 0], [2, 1.0]]), 45),
        (np.array([[1, 0], [1, 1.0]]), np.inf),
    ],
)
def test_shallowest_upper_face(profile, slope):
    assert geometry.shallowest_upper_face(profile) == pytest.approx(slope, abs=1e-6)


def test_flat_upper_face_is_a_warning():
    """Where the slope is less than the angle of rolling friction, 14 degrees for the study's 0.25."""
    changes = {"insert": {"shape": "bullet", "bullet": {"nose_slope_deg": 13}}, "factors": HEIGHTS}
    (line,) = config.parse(changes).warnings()
    assert without_designs(line) == (
        "insert.bullet: an upper face of 13 degrees: particles rest on it; "
        "usual: more than 14 (the angle of the wall's rolling friction)"
    )
    assert config.parse({**changes, "contact": {"wall": {"rolling_friction": 0.2}}}).warnings() == []
    assert config.parse({**changes, "contact": {"rolling": "none"}}).warnings() == []


SHAPES = {
    "double_cone": "lower_slope_deg, upper_slope_deg, length_mm",
    "bullet": "radius_mm, cylinder_length_mm, nose_slope_deg",
    "cone_in_cone": "slope_deg, length_mm, opening_radius_mm, thickness_mm",
}
HEIGHTS = {"height_mm": {"key": "insert.height_mm", "levels": [26, 28, 30, 32, 34]}}


def said(shape, **keys):
    """The mistakes of a study with one insert, varied in its height alone."""
    changes = {"insert": {"shape": shape, shape: keys}, "factors": HEIGHTS}
    with pytest.raises(ConfigError) as refused:
        config.parse(changes)
    return str(refused.value).splitlines()


def without_designs(line):
    """A sentence without the words that tell in which designs."""
    return re.sub(r" \(in exp_\d+: .* more\)", "", line)


@pytest.mark.parametrize("shape", SHAPES)
def test_each_shape_has_its_keys_and_fits_as_shipped(shape):
    study = config.parse({"insert": {"shape": shape}, "factors": HEIGHTS})
    assert study.simulation_case({"height_mm": 30}, "exp_01", 1)["walls"]["insert"][0][1] == 0.03
    (line,) = said(shape, size_mm=3)
    assert line == f"insert.{shape}.size_mm: unknown key (with 3); allowed: {SHAPES[shape]}"


@pytest.mark.parametrize(
    ("shape", "keys", "sentence"),
    [
        (
            "double_cone",
            {"lower_slope_deg": 95},
            "insert.double_cone.lower_slope_deg: 95 is not allowed; "
            "allowed: a number at least 1 and at most 89",
        ),
        (
            "double_cone",
            {"length_mm": 90, "lower_slope_deg": 20},
            "insert: an insert that touches the wall or lies beyond it is not allowed; "
            "allowed: a gap of at least 8 mm (2 coarse diameters)",
        ),
        (
            "bullet",
            {"radius_mm": 42.5, "cylinder_length_mm": 60},
            "insert: a gap of 4.24 mm between insert and wall is not "
            "allowed; allowed: a gap of at least 8 mm (2 coarse diameters)",
        ),
        (
            "bullet",
            {"nose_slope_deg": 90},
            "insert.bullet.nose_slope_deg: 90 is not allowed; allowed: a number at least 1 and at most 89",
        ),
        (
            "cone_in_cone",
            {"opening_radius_mm": 3.9},
            "insert.cone_in_cone: an opening of 7.8 mm through the insert is not allowed; "
            "allowed: at least 8 mm (2 coarse diameters)",
        ),
        (
            "cone_in_cone",
            {"opening_radius_mm": 1.9},
            "insert.cone_in_cone: a face that looks inwards on a circle of radius 1.9 mm is not allowed; "
            "allowed: no smaller than the largest sphere, 2 mm",
        ),
        (
            "cone_in_cone",
            {"thickness_mm": 1},
            "insert.cone_in_cone.thickness_mm: 1 is not allowed; "
            "allowed: at least 1.2 mm (spheres on either side of a thinner sheet may feel each other)",
        ),
        (
            "cone_in_cone",
            {"opening_radius_mm": 36},
            "insert: a gap of 2.18 mm between insert and wall is not "
            "allowed; allowed: a gap of at least 8 mm (2 coarse diameters)",
        ),
    ],
)
def test_insert_that_cannot_be_used(shape, keys, sentence):
    (line,) = said(shape, **keys)
    assert without_designs(line) == sentence


def test_narrow_opening_is_a_warning():
    changes = {"insert": {"shape": "cone_in_cone", "cone_in_cone": {"opening_radius_mm": 9}}}
    (line,) = config.parse({**changes, "factors": HEIGHTS}).warnings()
    assert without_designs(line) == (
        "insert.cone_in_cone: an opening through it of 4.5 coarse diameters may jam; usual: 5 or more"
    )


def test_profile_that_encloses_nothing_is_a_warning():
    roof = {"shape": "profile", "profile": {"points_mm": [[10, 20], [18, 0]]}}
    (line,) = config.parse({"insert": roof, "factors": HEIGHTS}).warnings()
    assert without_designs(line) == (
        "insert.profile: a shell without thickness: spheres on its two sides feel each other; "
        "usual: a line that closes, or that has both ends on the axis"
    )
    roof["profile"]["points_mm"] += [[10, 0], [10, 20]]
    assert config.parse({"insert": roof, "factors": HEIGHTS}).warnings() == []


def test_examples_are_one_of_each():
    shapes = {path.stem: shipped_example(path.stem).insert.shape for path in EXAMPLES}
    assert shapes == {name: name for name in (*SHAPES, "profile")} | {"fourth_factor": "cone"}
    assert len(shipped_example("fourth_factor").factors) == 4


@pytest.mark.parametrize("name", [path.stem for path in EXAMPLES])
def test_example_follows_its_own_factors_everywhere(name):
    study = shipped_example(name)
    assert study.results_dir == f"results/{name}"
    factors = list(study.factors)
    bounds = study.stage_params("optimise")["bounds"]
    assert list(bounds) == list(study.stage_params("optimise")["centre"]) == factors
    assert study.stage_params("gather")["factors"] == study.stage_params("filter")["factors"] == factors
    assert {"selected", "plan_centre", "bare"} <= study.cases().keys() and "paper" not in study.cases()
    for run, design in study.experiments():
        case = study.simulation_case(design, run, 1)
        assert list(case["design"]) == factors
        assert 13_000 < sum(case["particles"]["counts"]) < 16_000
    assert not [line for line in study.warnings() if "optimiser" in line]
    # Each factor changes the walls, and the optimiser finds no design that would be refused.
    walls_of = [study.with_design(corner).case({}, 0)["walls"] for corner in corners(study.levels)]
    assert len({str(found) for found in walls_of}) == 2 ** len(factors)


def test_paper_s_case_must_go_where_the_factors_are_others():
    bare = {"verification": {"cases": {"paper": {"theta_deg": 56.7, "length_mm": 32.4, "height_mm": 33.0}}}}
    with pytest.raises(ConfigError) as refused:
        example("bullet", bare)
    assert str(refused.value).startswith("verification.cases.paper: ")
    assert str(refused.value).endswith(
        "allowed: a number for each of height_mm, radius_mm, nose_slope_deg, or null to leave the case out"
    )


@pytest.mark.parametrize("name", [path.stem for path in EXAMPLES])
def test_tightest_design_of_an_example_runs(name):
    """Every sphere leaves, but for one that rolling friction may hold in balance on an edge."""
    study = example(name, {"filling": {"particles": 90}})
    gaps = {run: study.with_design(design).wall_gap for run, design in study.experiments()}
    tightest = min(gaps, key=gaps.get)
    run = experiment.run(study.simulation_case(dict(study.experiments())[tightest], tightest, 1))
    assert run["status"].item() in ("complete", "jammed")  # what is left is more than 0.1 % of 90 spheres
    assert run["residual_count"].item() <= 1
    assert run["lost_particles"].item() == 0
