"""The configuration: what it accepts, what it says about mistakes, and what reaches the stages."""

import datetime
import json
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopperopt import config, document
from hopperopt.config import ConfigError
from hopperopt.config.stages import STAGES

ROOT = Path(__file__).parents[2]
CENTRE = {"theta_deg": 55, "length_mm": 40, "height_mm": 29.6}


HEIGHTS = {"factors": {"height_mm": {"key": "insert.height_mm", "levels": [26, 28, 30, 32, 34]}}}
LENGTHS = {"factors": {"length_mm": {"key": "insert.cone.length_mm", "levels": [30, 35, 40, 45, 50]}}}


def nested(key, value):
    """The document that holds one value at a dotted key."""
    for part in reversed(key.split(".")):
        value = {part: value}
    return value


def sentences(changes, directory="."):
    """Mistakes of a document, a list of lines."""
    with pytest.raises(ConfigError) as refused:
        config.parse(changes, directory)
    return str(refused.value).splitlines()


def only(changes, directory="."):
    """The one mistake of a document."""
    (line,) = sentences(changes, directory)
    return line


def test_shipped_file_holds_the_defaults():
    assert config.parse(config.load([ROOT / "config.yaml"])) == config.parse({})


def test_shipped_file_names_every_key():
    shipped = set(document.dotted_keys(config.load([ROOT / "config.yaml"])))
    known = set(document.dotted_keys(config.parse({}).document))
    assert known - shipped == {"insert.profile.points_mm"}


def test_reduced_study_has_all_experiments_and_cases():
    whole = config.parse(config.load([ROOT / "config.yaml"]))
    reduced = config.parse(config.load([ROOT / "config.yaml", ROOT / "config/ci.yaml"]))
    assert [name for name, _ in reduced.experiments()] == [name for name, _ in whole.experiments()]
    assert reduced.cases().keys() == whole.cases().keys()
    assert reduced.results_dir == "results/ci"
    cases = [reduced.simulation_case(design, name, 1) for name, design in reduced.experiments()]
    assert all(2000 < sum(case["particles"]["counts"]) < 4000 for case in cases)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("sed", 1, "did you mean seed?"),
        ("hopper.outlet_radius", 22.5, "did you mean outlet_radius_mm?"),
        ("insert.cone.slop_deg", 55, "did you mean slope_deg?"),
        ("contact.particle.restitutoin", 0.7, "did you mean restitution?"),
        ("surrogate.starst", 100, "did you mean starts?"),
        ("design.lhs.experiment", 100, "did you mean experiments?"),
        ("length_mm", 40, "did you mean insert.cone.length_mm?"),
        ("factors.theta_deg", {"keys": "insert.cone.slope_deg", "levels": [50, 60]}, "did you mean key?"),
    ],
)
def test_unknown_key_is_named_with_its_value_and_the_nearest(key, value, said):
    line = only(nested(key, value))
    assert line.startswith(key) and said in line and "allowed: " in line


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("hopper.outlet_radius_mm", "wide", "a number at least 0.001"),
        ("hopper.outlet_radius_mm", True, "a number at least 0.001"),
        ("hopper.outlet_radius_mm", None, "a number at least 0.001"),
        ("hopper.outlet_radius_mm", [22.5], "a number at least 0.001"),
        ("hopper.outlet_radius_mm", float("nan"), "a number at least 0.001"),
        ("hopper.outlet_radius_mm", float("inf"), "a number at least 0.001"),
        ("hopper.outlet_radius_mm", ".inf", "a number at least 0.001"),
        ("hopper.outlet_radius_mm", 10**400, "a number at least 0.001"),
        ("hopper.outlet_radius_mm", "9" * 5000, "a number at least 0.001"),
        ("hopper.outlet_radius_mm", "22,5", "a number at least 0.001"),
        ("hopper.half_angle_deg", 91, "a number at least 1 and at most 90"),
        ("particles.density_kg_m3", -2285, "a number at least 10"),
        ("wall.shear_modulus_pa", "-.inf", "a number at least 1000 and at most 1e+13 or .inf"),
        ("wall.poisson_ratio", 0.6, "a number at least 0 and at most 0.5"),
        ("contact.particle.restitution", 1.1, "a number at least 0 and at most 1"),
        ("contact.rolling", "EDEM", "edem, cdt or none"),
        ("insert.shape", "cube", "cone, double_cone, bullet, cone_in_cone, profile or none"),
        ("insert.shape", None, "cone, double_cone, bullet, cone_in_cone, profile or none"),
        ("discharge.sensor_mm", 12, "a number at least -100000 and below 0"),
        ("insert.height_mm", 1e300, "a number at least 0.001 and at most 100000"),
        ("simulation.time_step_s", "automatic", "a number above 0 or auto"),
        ("simulation.time_step_s", True, "a number above 0 or auto"),
        ("filling.particles", 1000, "null or a multiple of 3"),
        ("filling.particles", 900.5, "a whole number at least 3 and at most 1e+07 or null"),
        ("filling.level_mm", -1, "a number at least 0.001"),
        ("surrogate.starts", 0, "a whole number at least 1"),
        ("surrogate.starts", "many", "a whole number at least 1"),
        ("surrogate.selected_hidden_nodes", "best", "a whole number at least 1 and at most 200 or auto"),
        ("surrogate.starts", 10**9, "at most 10000"),
        ("seed", 2**64, "at most 9.22337e+18"),
        ("discharge.time_limit_s", 1e6, "at most 10000"),
        ("design.lhs.experiments", 10_001, "at most 10000"),
        ("simulation.time_step_s", 1e-12, "at least 5.18e-09"),
        ("surrogate.hidden_nodes", [], "at least 1 entries"),
        ("surrogate.hidden_nodes", 7, "a list"),
        ("design.sobol.experiments", 25, "a power of two"),
        ("seed", -1, "a whole number at least 0"),
        ("results_dir", "", "the path of a folder"),
        ("results_dir", "results/{study}", "the path of a folder"),
        ("results_dir", "results\0", "the path of a folder"),
        ("results_dir", "9" * 400, "the path of a folder"),
        ("insert.profile.points_mm", [], "at least 2 entries"),
        ("insert.profile.points_mm", [[0, 0]] * 1001, "at most 1000 entries"),
        ("design.lhs.experiments", 10**6, "at most 10000"),
        ("filling.particles", 10**9, "at most 1e+07"),
        ("design.replicates", 401, "at most 400 for 25 designs"),
        ("verification.replicates", 1429, "at most 1428 for 7 designs"),
        ("verification.replicates_of.bare", 1429, "at most 1428 for 7 designs"),
        ("insert.cone.slope_deg", 0.96, "at least 1 and at most 89"),  # radians
        ("particles.density_kg_m3", 2.285, "at least 10"),  # g/cm3
        ("wall.shear_modulus_pa", 22, "at least 1000"),  # MPa
        ("hopper.outlet_radius_mm", datetime.date(2024, 1, 1), "a number"),
        ("results_dir", 5, "text"),
        ("insert", None, "the keys shape, height_mm, cone, double_cone, bullet, cone_in_cone, profile"),
        ("insert.cone", 55, "the keys slope_deg, length_mm"),
        ("factors.theta_deg", 55, "the keys key, levels"),
        ("factors", ["theta_deg"], "keys with their values"),
        ("verification.cases.middle", "centre", "plan_best, plan_centre, bare, or a number for each factor"),
    ],
)
def test_value_that_is_not_allowed(key, value, allowed):
    line = only(nested(key, value))
    assert line.startswith(f"{key}: {document.shown(value)} is not allowed; allowed: ")
    assert allowed in line


def test_diameters():
    for wrong in ([2, -3, 4], [2, 3, 0], [2, float("nan"), 4], [2, "x", 4]):
        assert "a number at least 0.001" in only({"particles": {"diameters_mm": wrong}})
    for wrong in ([2, 3], [4, 3, 2], [1, 2, 3, 4], []):
        assert "three diameters, ascending or equal" in only({"particles": {"diameters_mm": wrong}})
    config.parse({"particles": {"diameters_mm": [3, 3, 3]}})


@pytest.mark.parametrize(
    ("key", "value", "place", "allowed"),
    [
        ("insert.profile.points_mm", [[0, 0], [1]], "1.1: is missing", "a number"),
        ("insert.profile.points_mm", [[0, 0], [1, 2, 3]], "1: ", "at most 2 entries"),
        (
            "factors.theta_deg",
            {"key": "insert.cone.slope_deg", "levels": [50, "x"]},
            "levels.1: ",
            "a number",
        ),
        ("surrogate.hidden_nodes", ["x"], "0: ", "a whole number"),
    ],
)
def test_one_wrong_entry_of_a_list_is_one_mistake(key, value, place, allowed):
    line = only(nested(key, value))
    assert line.startswith(f"{key}.{place}") and f"allowed: {allowed}" in line


def test_missing_key_and_odd_keys():
    assert only({"factors": {"a_mm": {"levels": [1, 2]}}}).startswith(
        "factors.a_mm.key: is missing; allowed: text"
    )
    assert "quote it" in only({"factors": {True: {}}})


def test_all_mistakes_are_listed_together():
    lines = sentences(
        {
            "surrogat": {},
            "figures": {"dpi": "fine"},
            "hopper": {"cylinder_radius_mm": 20},
            "factors": {
                "theta_deg": {"key": "insert.cone.slope_deg", "levels": [60, 55, 52, 50]},
                "height_mm": {"key": "insert.hight_mm", "levels": [34, 32, 29.6, 28, 26]},
            },
        }
    )
    keys = [line.partition(":")[0] for line in lines]
    assert sorted(keys) == [
        "factors.height_mm.key",
        "factors.theta_deg.levels",
        "figures.dpi",
        "hopper.cylinder_radius_mm",
        "surrogat",
    ]
    assert all("\n" not in line and "pydantic" not in line for line in lines)


@pytest.mark.parametrize("typed", [4.0e-5, "4e-5", "4.0e-05", " 0.00004 "])
def test_text_that_plainly_is_a_number_is_one(typed):
    case = config.parse({"simulation": {"time_step_s": typed}}).simulation_case(CENTRE, "exp_01", 1)
    assert case["time_step"] == 4.0e-5


def test_case_does_not_depend_on_how_numbers_are_typed():
    cases = {
        json.dumps(
            config.parse(
                {"hopper": {"cylinder_radius_mm": number}, "filling": {"particles": count}}
            ).simulation_case({"theta_deg": angle, "length_mm": "40", "height_mm": 29.6}, "exp_01", 1),
            sort_keys=True,
        )
        for number, count, angle in [(50, 900, 55), (50.0, 900.0, 55.0), ("50", "900", "5.5e1")]
    }
    assert len(cases) == 1


def test_rigid_wall_is_accepted():
    for typed in (float("inf"), ".inf"):
        case = config.parse({"wall": {"shear_modulus_pa": typed}}).simulation_case(None, "bare", 1)
        assert case["wall"]["shear_modulus"] == float("inf")


def test_names_are_plain():
    line = only({"factors": {"Theta": {"key": "insert.cone.slope_deg", "levels": [50, 60, 52, 54, 56]}}})
    assert line.startswith('factors.Theta: "Theta" is not allowed; allowed: small letters')
    assert only({"insert": {"profile": {"file": True}}}).endswith("allowed: text or null")
    assert "at least 1 entries" in only({"verification": {"cases": {"selected": None}}})


@pytest.mark.parametrize(
    ("changes", "key", "allowed"),
    [
        ({"hopper": {"outlet_radius_mm": 55}}, "hopper.cylinder_radius_mm", "more than the outlet's radius"),
        (
            {"hopper": {"outlet_radius_mm": 1.9}, "insert": {"shape": "none"}},
            "hopper.outlet_radius_mm",
            "2 mm",
        ),
        ({"filling": {"level_mm": 0.074}}, "filling.level_mm", "at least a coarse diameter, 4 mm"),
        ({"simulation": {"time_step_s": 6e-5}}, "simulation.time_step_s", "at most 5.18e-05"),
        ({"particles": {"shear_modulus_pa": 1e8}}, "simulation.time_step_s", "at most 1.64e-05"),
    ],
)
def test_setup_that_cannot_be_simulated(changes, key, allowed):
    lines = [line for line in sentences(changes) if line.startswith(key)]
    assert len(lines) == 1 and allowed in lines[0]


@pytest.mark.parametrize(
    ("changes", "key", "said"),
    [
        ({"hopper": {"outlet_radius_mm": 0.0225}}, "hopper.outlet_radius_mm", "0.0225 m is 22.5 mm"),
        ({"hopper": {"cylinder_radius_mm": 0.05}}, "hopper.cylinder_radius_mm", "0.05 m is 50 mm"),
        ({"filling": {"level_mm": 0.074}}, "filling.level_mm", "0.074 m is 74 mm"),
        ({"particles": {"diameters_mm": [0.002, 0.003, 0.004]}}, "particles.diameters_mm", "0.004 m is 4 mm"),
        ({"insert": {"height_mm": 0.0296}, **LENGTHS}, "insert", "0.0296 m is 29.6 mm"),
    ],
)
def test_metres_for_millimetres_are_one_sentence_that_asks(changes, key, said):
    line = only(changes)
    assert line.startswith(f"{key}: ") and line.endswith(f" (in metres? {said})")


@pytest.mark.parametrize(
    "changes", [{"discharge": {"sensor_mm": -1300}}, {"simulation": {"gravity_m_s2": 0.05}}]
)
def test_sensor_that_no_sphere_reaches_before_the_run_counts_as_idle(changes):
    line = only(changes)
    assert line.startswith("discharge.idle_limit_s: 0.5 is not allowed; allowed: more than 0.")
    assert "falls from the outlet to the sensor" in line


def test_sharp_edge_of_an_insert_is_a_warning():
    changes = {"factors": {"theta_deg": {"key": "insert.cone.slope_deg", "levels": [16, 18, 30, 40, 50]}}}
    changes |= {"insert": {"cone": {"length_mm": 20}}}
    (line,) = [line for line in config.parse(changes).warnings() if "feels both" in line]
    assert line.startswith("insert.cone: an edge of 16 degrees") and "usual: 20 or more" in line


@pytest.mark.parametrize(
    ("changes", "key", "said"),
    [
        ({"discharge": {"sensor_mm": -0.012}}, "discharge.sensor_mm", "(in metres? 0.012 m is 12 mm)"),
        ({"insert": {"cone": {"length_mm": 0.04}}, **HEIGHTS}, "insert.cone", "0.02294 m is 22.94 mm"),
        (
            {
                "particles": {"diameters_mm": [0.02, 0.03, 0.04]},
                "filling": {"particles": 300},
                "simulation": {"time_step_s": "auto"},
            },
            "hopper.outlet_radius_mm",
            "at most 200 (all lengths in mm)",
        ),
    ],
)
def test_lengths_that_are_allowed_but_hardly_meant_are_a_warning(changes, key, said):
    (line,) = [line for line in config.parse(changes).warnings() if line.startswith(key)]
    assert said in line


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"particles": {"shear_modulus_pa": 4e6}}, "particles.shear_modulus_pa"),
        ({"filling": {"speed_m_s": 5}}, "particles.shear_modulus_pa"),
        ({"particles": {"diameters_mm": [1.6, 3, 5]}}, "particles.shear_modulus_pa"),
        ({"contact": {"particle": {"restitution": 0.9}}}, "contact.particle.restitution"),
        ({"contact": {"wall": {"restitution": 0.9}}}, "contact.particle.restitution"),
        (
            {"contact": {"particle": {"restitution": 0.85}}, "particles": {"diameters_mm": [2, 2.5, 3.2]}},
            "contact.particle.restitution",
        ),
        ({"particles": {"diameters_mm": [1.5, 3, 4]}}, "particles.diameters_mm"),
        (
            {"simulation": {"time_step_s": 4e-5}, "wall": {"shear_modulus_pa": ".inf"}},
            "simulation.time_step_s",
        ),
    ],
)
def test_impacts_that_break_the_monitors_are_a_warning(changes, key):
    """Soft spheres below heavy ones, and light ones that fly off them; the study itself is clear of all."""
    changes = {"simulation": {"time_step_s": "auto"}, **changes}
    assert [line for line in config.parse(changes).warnings() if line.startswith(key)]
    assert not [line for line in config.parse({}).warnings() if line.startswith(key)]


def test_value_that_the_factors_replace_is_in_no_design():
    config.parse({"insert": {"height_mm": 1, "cone": {"length_mm": 900}}})


def three_factors(**levels):
    """Factors of the study with other levels."""
    return {"factors": {name: {"levels": values} for name, values in levels.items()}}


def with_paper(changes):
    """Changes merged over the shipped file."""
    return document.merge(config.load([ROOT / "config.yaml"]), changes)


def test_insert_that_does_not_fit_is_said_once_for_the_worst_design():
    line = only(with_paper(three_factors(length_mm=[90, 45, 40, 35, 30])))
    assert line.startswith("insert: an insert that touches the wall or lies beyond it (in exp_")
    assert "length_mm 90" in line and "and 4 more" in line and "at least 8 mm (2 coarse diameters)" in line


def test_insert_that_blocks_is_refused_and_a_narrow_gap_is_a_warning():
    line = only(with_paper(three_factors(height_mm=[34, 32, 29.6, 28, 20])))
    assert line.startswith("insert: a gap of 7.33 mm between insert and wall (in exp_21: ")
    (narrow,) = [
        line for line in config.parse({}).warnings() if line.startswith("insert: a gap to the wall of 2.89")
    ]
    assert "exp_21: theta_deg 50, length_mm 50, height_mm 26" in narrow


def test_a_fixed_number_of_particles_that_misses_the_level_is_a_warning():
    count, key = config.parse({}).particle_count, "filling.level_mm"
    few, right = ({"filling": {"particles": number}} for number in (999, count))
    (line,) = [line for line in config.parse(few).warnings() if line.startswith(key)]
    assert "999 particles fill the hopper to about 12 mm, not 74 mm" in line
    assert not [line for line in config.parse(right).warnings() if line.startswith(key)]


def test_apex_above_the_bed_is_only_a_warning():
    (line,) = [line for line in config.parse({}).warnings() if "its top" in line]
    assert "77.3 mm" in line and "exp_01" in line and "and 1 more" in line


@pytest.mark.parametrize(
    ("changes", "warned"),
    [
        ({}, False),
        ({"simulation": {"time_step_s": 4.2e-5}}, True),
        ({"contact": {"particle": {"restitution": 0.8}}}, True),
        ({"contact": {"wall": {"static_friction": 1}}}, True),
        ({"contact": {"wall": {"static_friction": 1}}, "simulation": {"time_step_s": 2e-5}}, False),
        ({"contact": {"wall": {"static_friction": 1}}, "simulation": {"time_step_s": "auto"}}, False),
    ],
)
def test_long_step_is_a_warning_outside_the_tested_materials(changes, warned):
    lines = config.parse(changes).warnings()
    assert any(line.startswith("simulation.time_step_s") for line in lines) == warned


def test_narrow_outlet_is_a_warning():
    changes = {"hopper": {"outlet_radius_mm": 9.9}, "verification": {"cases": {"bare": "bare"}}}
    plan = {"plan": "lhs"}, {"theta_deg": {"key": "insert.cone.slope_deg", "levels": [59, 60]}}
    small = {"cone": {"length_mm": 10}}
    study = config.parse({**changes, "design": plan[0], "factors": plan[1], "insert": small})
    assert [
        line for line in study.warnings() if line.startswith("hopper.outlet_radius_mm: an outlet of 4.95 ")
    ]
    assert not [line for line in config.parse({}).warnings() if line.startswith("hopper")]


def plan_file(folder, text):
    """Changes that take the plan from a CSV file."""
    (folder / "plan.csv").write_text(text)
    few = {"validation_experiments": 1, "test_experiments": 1, "selected_hidden_nodes": 7}
    return {"design": {"plan": "csv"}, "surrogate": few}


TWO_FACTORS = {
    "length_mm": {"key": "insert.cone.length_mm", "levels": [30, 50]},
    "height_mm": {"key": "insert.height_mm", "levels": [15, 34]},
}
FOUR_ROWS = "experiment,length_mm,height_mm\nlow,30,15\nhigh,50,34\na,40,30\nb,40,34\n"


def test_corner_of_the_ranges_that_does_not_fit_is_a_warning(tmp_path):
    study = config.parse({**plan_file(tmp_path, FOUR_ROWS), "factors": TWO_FACTORS}, tmp_path)
    (line,) = [line for line in study.warnings() if "optimiser" in line]
    assert "a corner: length_mm 50, height_mm 15" in line


def test_own_plan_is_read_with_the_configuration(tmp_path):
    study = config.parse({**plan_file(tmp_path, FOUR_ROWS), "factors": TWO_FACTORS}, tmp_path)
    assert study.experiments()[0] == ("low", {"length_mm": 30.0, "height_mm": 15.0})
    (tmp_path / "plan.csv").unlink()
    assert len(study.experiments()) == 4
    assert "cannot" not in only({"design": {"plan": "csv"}, "factors": TWO_FACTORS}, tmp_path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the columns experiment, length_mm, height_mm"),
        ("experiment,length_mm\na,40\n", "the columns experiment, length_mm, height_mm"),
        (FOUR_ROWS + "a,41,31\n", "a is there twice"),
        (FOUR_ROWS + "c-1,41,31\n", "line 6 has 'c-1'"),
        (FOUR_ROWS + "infill_1_1,41,31\n", "names that do not begin with infill_ (line 6"),
        (FOUR_ROWS + "c,41\n", "line 6 has height_mm None"),
        (FOUR_ROWS + "c,nan,30\n", "line 6 has length_mm 'nan'"),
        (FOUR_ROWS + "c,1_000,30\n", "line 6 has length_mm '1_000'"),
        ("experiment,length_mm,length_mm,height_mm\na,40,41,30\n", "each once"),
        (f'experiment,length_mm,height_mm\na,40,"{"9" * 200_000}"\n', "each once"),
        ("experiment,length_mm,height_mm\n" + "a,40,30\n" * 10_001, "at most 10000 experiments (10001 are"),
    ],
)
def test_own_plan_that_cannot_be_used(tmp_path, text, said):
    line = only({**plan_file(tmp_path, text), "factors": TWO_FACTORS}, tmp_path)
    assert line.startswith('design.csv.file: "plan.csv" is not allowed') and said in line


def test_own_plan_is_checked_like_any_other(tmp_path):
    changes = {**plan_file(tmp_path, FOUR_ROWS + "c,-5,30\n"), "factors": TWO_FACTORS}
    line = only(changes, tmp_path)
    assert line.startswith("insert.cone.length_mm: -5.0 is not allowed; ") and line.endswith(" (in c)")
    changes = {**plan_file(tmp_path, FOUR_ROWS + "bare,50,30\n"), "factors": TWO_FACTORS}
    assert only(changes, tmp_path).startswith("verification.cases.bare: ")


@pytest.mark.parametrize(
    ("changes", "key", "said"),
    [
        (three_factors(theta_deg=[60, 55, 52, 50]), "factors.theta_deg.levels", "five levels"),
        (three_factors(theta_deg=[60, 55, 55, 52, 50]), "factors.theta_deg.levels", "levels that differ"),
        (three_factors(theta_deg=[95, 55, 54, 52, 50]), "factors.theta_deg.levels", "at most 89"),
        ({"factors": {"theta_deg": {"key": "insert.cone.slop_deg"}}}, "factors.theta_deg.key", "slope_deg?"),
        (
            {"factors": {"theta_deg": {"key": "insert.height_mm"}}},
            "factors.height_mm.key",
            "theta_deg does not",
        ),
        ({"factors": {"theta_deg": {"key": "surrogate.seed"}}}, "factors.theta_deg.key", "simulations use"),
        (
            {"factors": {"theta_deg": {"key": "insert.shape"}}},
            "factors.theta_deg.levels",
            "cone, profile or none",
        ),
        ({"insert": {"shape": "none"}}, "factors.theta_deg.key", "makes none"),
        (
            {"factors": {"theta_deg": {"key": "particles.diameters_mm.2"}}},
            "factors.theta_deg.key",
            "other than the diameters",
        ),
        (
            {"factors": {"moved": {"key": "wall.poisson_ratio", "levels": [0.2, 0.3]}}},
            "factors.moved",
            "a name",
        ),
        (
            {"design": {"plan": "lhs", "lhs": {"experiments": 10}}},
            "surrogate.validation_experiments",
            "10 experiments are too few",
        ),
        (
            {
                "design": {"plan": "lhs", "lhs": {"experiments": 8}},
                "surrogate": {
                    "selected_hidden_nodes": "auto",
                    "validation_experiments": 1,
                    "test_experiments": 4,
                },
            },
            "surrogate.selected_hidden_nodes",
            "5 experiments or more",
        ),
        ({"surrogate": {"selected_hidden_nodes": 11}}, "surrogate.selected_hidden_nodes", "auto or one of 3"),
        ({"surrogate": {"hidden_nodes": [7, 7]}}, "surrogate.hidden_nodes", "differ"),
        ({"surrogate": {"test_experiments": 21}}, "surrogate.validation_experiments", "at most 23"),
        ({"optimise": {"select": "explicit"}}, "optimise.explicit", "theta_deg, length_mm, height_mm"),
        (
            {"optimise": {"select": "explicit", "explicit": {**CENTRE, "theta_deg": 61}}},
            "optimise.explicit.theta_deg",
            "50 to 60",
        ),
        (
            {"verification": {"cases": {"other": {"theta_deg": 56.7}}}},
            "verification.cases.other",
            "a number for",
        ),
        (
            {"verification": {"cases": {"paper": {**CENTRE, "length_mm": -1}}}},
            "verification.cases.paper",
            "a number at least 0.001",
        ),
        ({"verification": {"cases": {"exp_01": "bare"}}}, "verification.cases.exp_01", "no experiment"),
        (
            {"verification": {"cases": {"infill_1_2": "bare"}}},
            "verification.cases.infill_1_2",
            "no experiment",
        ),
        (
            {"infill": {"rounds": 100, "batch": 100}},
            "design.replicates",
            "at most 1 for 10000 designs of infill",
        ),
        ({"verification": {"cases": {"plan_best": CENTRE}}}, "verification.cases.plan_best", "is that"),
        ({"verification": {"replicates_of": {"bear": 3}}}, "verification.replicates_of.bear", "plan_best"),
    ],
)
def test_parts_that_do_not_go_together(changes, key, said):
    lines = sentences(with_paper(changes))
    assert lines[0].startswith(f"{key}: ") and said in lines[0]


def test_small_plan_that_can_be_split_is_accepted(tmp_path):
    corners = "experiment,length_mm,height_mm\na,30,15\nb,50,34\nc,30,34\nd,40,20\ne,45,30\n"
    changes = {**plan_file(tmp_path, corners), "factors": TWO_FACTORS}
    changes["surrogate"] |= {"test_experiments": 2, "hidden_nodes": [7]}
    assert len(config.parse(changes, tmp_path).plan) == 5


@pytest.mark.parametrize(("length", "warned"), [(50, False), (51, True)])
def test_case_outside_the_ranges_is_a_warning(length, warned):
    case = {"theta_deg": 56.7, "length_mm": length, "height_mm": 33}
    lines = config.parse({"verification": {"cases": {"long": case}, "replicates_of": {}}}).warnings()
    said = "verification.cases.long.length_mm: 51 lies outside the factor's range, 30 to 50"
    assert any(line.startswith(said) for line in lines) == warned


def test_own_plan_narrower_than_its_levels_is_a_warning(tmp_path):
    narrow = "experiment,length_mm,height_mm\na,32,15\nb,50,34\nc,32,34\nd,40,20\ne,45,15\n"
    study = config.parse({**plan_file(tmp_path, narrow), "factors": TWO_FACTORS}, tmp_path)
    (line,) = [line for line in study.warnings() if "of the plan" in line]
    assert line.startswith("factors.length_mm.levels: ") and "30 to 50" in line and "32 to 50" in line


def test_columns_of_an_own_plan_that_are_no_factors_are_a_warning(tmp_path):
    rows = [f"{row},,22.5," for row in FOUR_ROWS.split()[1:]]
    text = "\n".join([f"{FOUR_ROWS.split()[0]},length_mm_level,outlet_radius_mm,", *rows])
    study = config.parse({**plan_file(tmp_path, text), "factors": TWO_FACTORS}, tmp_path)
    (line,) = [line for line in study.warnings() if "column" in line]
    assert line.startswith("design.csv.file: plan.csv has a column outlet_radius_mm, which is no factor")


def test_null_leaves_out_a_factor_and_a_case():
    study = config.parse(
        with_paper({"factors": {"theta_deg": None}, "verification": {"cases": {"bare": None, "paper": None}}})
    )
    assert list(study.levels) == ["length_mm", "height_mm"]
    assert list(study.cases()) == ["selected", "best_f", "best_i", "plan_best", "plan_centre"]


def test_the_papers_design_is_a_default_case_with_its_factors_alone():
    assert "paper" in config.parse({}).cases()
    factors = {name: factor.model_dump() for name, factor in config.parse({}).factors.items()}
    for verification in ({}, {"replicates": 3}):
        study = config.parse({"factors": factors | {"height_mm": None}, "verification": verification})
        assert list(study.cases()) == ["selected", "best_f", "best_i", "plan_best", "plan_centre", "bare"]
    line = only(with_paper({"factors": {"height_mm": None}}))
    assert line.startswith("verification.cases.paper: ")


def test_each_case_has_its_number_of_runs():
    runs = config.parse({}).verification.replicates_in
    assert [runs(name) for name in ("selected", "plan_best", "best_f", "bare")] == [20, 20, 10, 10]
    changes = {"verification": {"replicates": 4, "replicates_of": {"bare": 7}}}
    runs = config.parse(changes).verification.replicates_in
    assert [runs(name) for name in ("selected", "bare")] == [4, 7]


def test_cases():
    paper = {"theta_deg": 56.7, "length_mm": "32.4", "height_mm": 33}
    study = config.parse(with_paper({"verification": {"cases": {"paper": paper}}}))
    assert study.cases() == {
        **{word: word for word in ("selected", "best_f", "best_i", "plan_best")},
        "plan_centre": CENTRE,
        "paper": {"theta_deg": 56.7, "length_mm": 32.4, "height_mm": 33.0},
        "bare": None,
    }


def test_any_number_can_be_a_factor():
    factors = {
        "density_kg_m3": {"key": "particles.density_kg_m3", "levels": [2000, 2500]},
        "friction": {"key": "contact.wall.static_friction", "levels": [0.3, 0.5]},
    }
    design = {"plan": "lhs", "lhs": {"experiments": 12}}
    study = config.parse({"factors": factors, "design": design})
    case = study.simulation_case({"density_kg_m3": 2100, "friction": 0.4}, "exp_01", 1)
    assert case["particles"]["density"] == 2100
    assert case["contact"]["wall"]["static_friction"] == 0.4
    assert case["design"] == {"density_kg_m3": 2100, "friction": 0.4}


def test_case_of_the_centre():
    case = config.parse({}).simulation_case(CENTRE, "plan_centre", 1)
    (outlet, edge, top, rim), gate, insert = (case["walls"][name] for name in ("hopper", "gate", "insert"))
    assert (outlet, edge, gate) == ([0.0225, 0.0], [0.05, 0.0275], [[0.0, 0.0], [0.0225, 0.0]])
    assert insert == [[0.0, 0.0296], [0.022943057454, 0.0296], [0.0, 0.062366081772]]
    count = sum(case["particles"]["counts"])
    assert 14_700 < count < 15_000
    fine, _, coarse = case["particles"]["diameters"]
    column = count / 3 * 3.141592653589793 / 6 * (fine**3 + 0.003**3 + coarse**3) / 0.2
    assert top[0] == 0.05
    rise = 0.25**2 / (2 * 9.81)  # of a particle that starts upwards at five standard deviations
    assert top[1] == pytest.approx(0.079 + column / (3.141592653589793 * 0.048**2) + 0.004 + rise + 0.02)
    head = top[1] + 0.75**2 / (2 * 9.81)  # from where it would fall that starts downwards at five
    assert rim == [0.05, pytest.approx(4 * head)]  # at twice the speed of fall it rises no higher
    assert json.loads(json.dumps(case)) == case


def test_case_of_the_paper_is_in_si():
    case = config.parse({}).simulation_case(CENTRE, "plan_centre", 1)
    assert case["particles"] | {"counts": None} == {
        "diameters": [0.002, 0.003, 0.004],
        "counts": None,
        "density": 2285,
        "shear_modulus": 1e7,
        "poisson_ratio": 0.25,
    }
    assert case["wall"] == {"shear_modulus": 2.2e7, "poisson_ratio": 0.25}
    assert case["contact"] == {
        "rolling": "edem",
        "particle": {"static_friction": 0.5, "rolling_friction": 0.05, "restitution": 0.7},
        "wall": {"static_friction": 0.5, "rolling_friction": 0.25, "restitution": 0.2},
    }
    assert case["filling"] == {
        "level": 0.074,
        "column_radius": 0.048,
        "column_bottom": 0.079,
        "solid_fraction": 0.2,
        "speed": 0.5,
        "speed_scatter": 0.05,
        "settling_limit": 1.5,
    }
    assert case["discharge"] == {"sensor": -0.012, "idle_limit": 0.5, "time_limit": 10}
    assert (case["time_step"], case["gravity"]) == (4e-5, 9.81)


def test_rayleigh_time_and_automatic_step():
    study = config.parse({"simulation": {"time_step_s": "auto"}})
    assert study.particles.rayleigh_time == pytest.approx(5.18e-5, abs=0.005e-5)
    step = study.simulation_case(CENTRE, "exp_01", 1)["time_step"]
    assert step == pytest.approx(0.2 * study.particles.rayleigh_time, rel=1e-5)


def test_column_starts_above_a_high_apex_and_above_the_cone():
    study = config.parse({})
    high = study.simulation_case({"theta_deg": 60, "length_mm": 50, "height_mm": 34}, "exp_01", 1)
    apex = high["walls"]["insert"][-1][1]
    assert apex > 0.074 and high["filling"]["column_bottom"] == pytest.approx(apex + 0.005)
    low = config.parse({"filling": {"level_mm": 10, "particles": 900}}).simulation_case(None, "bare", 1)
    assert low["filling"]["column_bottom"] == pytest.approx(0.0275 + 0.005)


def test_particle_counts_of_the_plan_are_the_papers():
    study = config.parse({})
    counts = [
        sum(study.simulation_case(design, name, 1)["particles"]["counts"])
        for name, design in study.experiments()
    ]
    assert min(counts) > 14_050 and max(counts) < 15_250  # about 14,100 to 15,200


def test_bare_hopper_has_nothing_of_an_insert():
    changes = {"insert": {"height_mm": 30, "cone": {"slope_deg": 40}}}
    bare, other = (config.parse(with_paper(c)).simulation_case(None, "bare", 1) for c in ({}, changes))
    assert bare == other
    assert bare["walls"]["insert"] is None and bare["design"] == {}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("results_dir", "elsewhere"),
        ("surrogate.starts", 5),
        ("surrogate.selected_hidden_nodes", 5),
        ("optimise.seed", 2),
        ("figures.dpi", 300),
        ("verification.replicates", 3),
        ("design.replicates", 3),
        ("discharge.incomplete", "drop"),
        ("simulation.threads", 4),
        ("simulation.checkpoint_minutes", None),
        ("insert.profile.file", "unused.csv"),
        ("insert.height_mm", 30),
        ("factors.theta_deg.levels", [61, 57.5, 55, 52.5, 50]),
    ],
)
def test_case_and_derived_case_hold_nothing_of_other_sections(key, value):
    plain, changed = config.parse({}), config.parse(with_paper(nested(key, value)))
    assert plain.simulation_case(CENTRE, "exp_13", 1) == changed.simulation_case(CENTRE, "exp_13", 1)
    assert plain.derived_params("selected", 1) == changed.derived_params("selected", 1)


def test_a_case_without_snapshots_does_not_tell_of_them():
    """So that the runs of a study without them are what they were before there were any."""
    plain, recorded = (config.parse({"simulation": {"snapshot_interval_s": s}}) for s in (None, "0.02"))
    assert "snapshot" not in json.dumps(plain.simulation_case(CENTRE, "exp_13", 1))
    assert "snapshot" not in json.dumps(plain.derived_params("selected", 1))
    case = recorded.simulation_case(CENTRE, "exp_13", 1)
    assert case.pop("snapshot_interval") == 0.02
    assert case == plain.simulation_case(CENTRE, "exp_13", 1)
    found = config.derived_case(recorded.derived_params("exp_13", 1), CENTRE)
    assert found == case | {"snapshot_interval": 0.02}


def test_derived_case_is_that_of_the_same_design():
    study = config.parse(with_paper({"insert": {"height_mm": 31}, "wall": {"shear_modulus_pa": ".inf"}}))
    params = json.loads(json.dumps(study.derived_params("selected", 2)))
    assert config.derived_case(params, CENTRE) == study.simulation_case(CENTRE, "selected", 2)
    with pytest.raises(ConfigError, match="touches the wall"):
        config.derived_case(params, {**CENTRE, "length_mm": 90})


def test_seed_follows_from_study_name_and_replicate():
    study, other = config.parse({}), config.parse({"seed": 2})
    seeds = {
        s.simulation_case(CENTRE, name, replicate)["seed"]
        for s in (study, other)
        for name in ("exp_01", "exp_02", "selected")
        for replicate in (1, 2)
    }
    assert len(seeds) == 12
    assert study.simulation_case(CENTRE, "exp_01", 1)["seed"] == study.derived_params("exp_01", 1)["seed"]


def test_design_is_validated():
    study = config.parse({})
    for design, said in [
        ({"theta": 55}, "allowed: theta_deg, length_mm, height_mm"),
        ({"theta_deg": "steep"}, "insert.cone.slope_deg: "),
        ({"theta_deg": True}, "insert.cone.slope_deg: "),
        ({"length_mm": 90}, "touches the wall"),
    ]:
        with pytest.raises(ConfigError, match=said):
            study.simulation_case(design, "by_hand", 1)


def test_largest_seed_is_allowed_and_kept():
    assert config.parse({"seed": 2**63 - 1}).seed == 2**63 - 1
    with pytest.raises(config.ConfigError, match="seed: 9223372036854775808 is not allowed"):
        config.parse({"seed": 2**63})


def test_stage_params_hold_their_own_settings_in_order():
    study = config.parse({})
    assert study.stage_params("gather") == {"factors": list(CENTRE), "incomplete": "refuse"}
    assert study.stage_params("optimise")["bounds"]["length_mm"] == [30.0, 50.0]
    assert study.stage_params("optimise")["centre"] == CENTRE
    cases = study.stage_params("verify")["cases"]
    assert [name for name, _ in cases] == list(study.cases())
    assert cases[0] == ["selected", "selected"] and cases[-2:] == [["paper", "design"], ["bare", "bare"]]
    assert study.stage_params("train")["hidden_nodes"] == [3, 4, 5, 6, 7, 8, 9, 10]
    for stage in STAGES:
        params = study.stage_params(stage)
        assert json.loads(json.dumps(params, sort_keys=True)) == params


def test_profile_insert(tmp_path):
    (tmp_path / "body.csv").write_text("r_mm,z_mm\n0,0\n10,0\n10,5\n0,20\n")
    changes = {
        "insert": {"shape": "profile", "profile": {"file": "body.csv"}},
        "factors": {"height_mm": {"key": "insert.height_mm", "levels": [26, 28, 30, 32, 34]}},
    }
    study = config.parse(changes, tmp_path)
    case = study.simulation_case({"height_mm": 30}, "exp_01", 1)
    assert case["walls"]["insert"] == [[0, 0.03], [0.01, 0.03], [0.01, 0.035], [0, 0.05]]
    params = study.derived_params("selected", 1)
    assert config.derived_case(params, {"height_mm": 30})["walls"] == case["walls"]


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ("0,0\n10,0\n-1,20\n", "crosses the axis"),
        ("0,0\n10,0\n0,10\n5,15\n0,20\n", "crosses the axis"),
        ("0,0\n10,10\n10,0\n0,10\n", "crosses or touches itself"),
        ("0,0\n10,0\n5,0\n0,10\n", "crosses or touches itself"),
        ("0,0\n10,0\n10,0\n0,10\n", "crosses or touches itself"),
        ("1,0\n1,10\n", "a circle of radius 1 mm"),
        ("0,5\n10,0\n0,20\n", "a circle of radius 0 mm"),
        ("0,-40\n10,-40\n0,20\n", "touches the wall or lies beyond it"),
        ("0,0\nx,0\n", "the columns r_mm, z_mm"),
        ("0,0\n", "the columns r_mm, z_mm"),
    ],
)
def test_profile_insert_that_cannot_be_used(tmp_path, points, said):
    (tmp_path / "body.csv").write_text(f"r_mm,z_mm\n{points}")
    changes = {
        "insert": {"shape": "profile", "profile": {"file": "body.csv"}},
        "factors": {"height_mm": {"key": "insert.height_mm", "levels": [26, 28, 30, 32, 34]}},
    }
    assert said in only(changes, tmp_path)


def test_profile_without_points():
    factors = {"height_mm": {"key": "insert.height_mm", "levels": [26, 28, 30, 32, 34]}}
    line = only({"insert": {"shape": "profile"}, "factors": factors})
    assert line.startswith("insert.profile.file: null is not allowed; allowed: a CSV file")
    line = only({"insert": {"shape": "profile", "profile": {"file": "none.csv"}}, "factors": factors})
    assert line.startswith("insert.profile.file: ") and "No such file" in line


documents = st.recursive(
    st.one_of(st.none(), st.integers(), st.text(max_size=2), st.lists(st.integers(), max_size=2)),
    lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=8,
).filter(lambda value: isinstance(value, dict))


@settings(deadline=None)
@given(st.lists(documents, max_size=3))
def test_files_merge_as_snakemake_merges(parts):
    from snakemake.utils import update_config

    expected, merged = {}, {}
    for part in parts:
        update_config(expected, json.loads(json.dumps(part)))
        document.merge(merged, json.loads(json.dumps(part)))
    assert merged == expected


def test_files_are_read_as_snakemake_reads_them(tmp_path):
    from snakemake.common.configfile import load_configfile
    from snakemake.utils import update_config

    (tmp_path / "a.yaml").write_text("filling: {level_mm: 70, particles: null}\nseed: 5e-4\nx: [1, 2]\n")
    (tmp_path / "b.json").write_text('{"filling": {"particles": 900}, "x": [3]}')
    paths = [tmp_path / "a.yaml", tmp_path / "b.json"]
    expected = {}
    for path in paths:
        update_config(expected, load_configfile(path))
    assert config.load(paths) == expected
    assert config.load(paths, {"seed": 3})["seed"] == 3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seed: 1\nfilling: {level_mm: 74}\nseed: 2\n", "line 3: seed: is there twice"),
        (
            "filling:\n  level_mm: 70\n  particles: 60\n  level_mm: 74\n",
            "line 4: filling.level_mm: is there twice",
        ),
        ('{"filling": {"level_mm": 70, "level_mm": 74}}', "level_mm: is there twice"),
        ("hopper: {outlet_radius_mm: 010}\n", 'line 1: hopper.outlet_radius_mm: "010" is not allowed'),
        ("factors:\n  a: {key: k, levels: [1, 1:30]}\n", 'line 2: factors.a.levels.1: "1:30" is not allowed'),
        ("discharge: {time_limit_s: 1:30.5}\n", '"1:30.5" is not allowed'),
    ],
)
def test_what_yaml_takes_silently_is_said(tmp_path, text, said):
    """Of two equal keys the last counts, 010 is 8 and 1:30 is 90: nobody means that."""
    (tmp_path / "config.yaml").write_text(text)
    with pytest.raises(ConfigError) as refused:
        config.load([tmp_path / "config.yaml"])
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_what_yaml_reads_as_something_else(tmp_path):
    """Text, booleans and dates in a number's place; underscores and signs are plain."""
    (tmp_path / "a.yaml").write_text(
        "filling: {particles: 1_200}\nsimulation: {time_step_s: 2e-5}\nseed: +7\n"
    )
    study = config.parse(config.load([tmp_path / "a.yaml"]))
    assert (study.filling.particles, study.time_step, study.seed) == (1200, 2e-5, 7)
    (tmp_path / "b.yaml").write_text("seed: yes\nfigures: {dpi: 2024-01-01}\non: 1\n")
    with pytest.raises(ConfigError) as refused:
        config.parse(config.load([tmp_path / "b.yaml"]))
    assert "quote it" in str(refused.value)
    (tmp_path / "c.yaml").write_text("seed: yes\nfigures: {dpi: 2024-01-01}\n")
    lines = sentences(config.load([tmp_path / "c.yaml"]))
    assert [line.partition(" is not")[0] for line in lines] == ["seed: true", 'figures.dpi: "2024-01-01"']


def test_keys_and_values_stay_on_their_line():
    """Whatever stands in a key or a value: one mistake is one line that can be printed."""
    line = only({"a\nb": 1})
    assert line.startswith('"a\\nb": ') and "letters" in line
    for value in ("a\nb", "\ud800", "\x1b[31m"):
        assert only({"seed": value}).isprintable()


def test_file_names_that_no_file_can_have(tmp_path):
    for name in ("plan\0.csv", "9" * 400, "."):
        line = only({"design": {"plan": "csv", "csv": {"file": name}}}, tmp_path)
        assert line.startswith("design.csv.file: ")


def test_file_in_the_place_of_the_results_folder(tmp_path):
    (tmp_path / "results").write_text("")
    for path in ("results", "results/pilot"):
        line = only({"results_dir": path}, tmp_path)
        assert line.startswith(f'results_dir: "{path}"') and line.endswith("results is a file)")


def test_middle_levels_are_a_design_that_is_allowed():
    """The optimum's runs are planned with them: what is not allowed there is said before anything runs."""
    factors = {"count": {"key": "filling.particles", "levels": [60, 63]}}
    lines = sentences(
        {"factors": factors, "verification": {"cases": {"bare": "bare"}}, "design": {"plan": "lhs"}}
    )
    assert any(line.startswith("factors (the middle levels): filling.particles: 61.5 ") for line in lines)


@pytest.mark.parametrize("text", ["a: [1", "- 1\n- 2", "", "a: 1\n\tb: 2", "d: 2024-13-45", "a: &a {b: *a}"])
def test_file_that_is_no_configuration(tmp_path, text):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as refused:
        config.load([path])
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def test_missing_and_binary_files(tmp_path):
    (tmp_path / "b.yaml").write_bytes(b"\xff\xfe\x00")
    for name in ("a.yaml", "b.yaml"):
        with pytest.raises(ConfigError, match=name):
            config.load([tmp_path / name])


def test_parsing_imports_no_slow_module():
    slow = "{'scipy', 'sklearn', 'pymoo', 'matplotlib', 'numba', 'pandas', 'xarray'}"
    code = f"import sys; import hopperopt.config; print(sorted({slow} & set(sys.modules)))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip() == "[]"
