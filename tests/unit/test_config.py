"""The configuration: what it accepts, what it says about mistakes, and what reaches the stages."""

import json
from pathlib import Path

import pytest

from hopperopt import config, document
from hopperopt.config import ConfigError

ROOT = Path(__file__).parents[2]
CENTRE = {"theta_deg": 55, "length_mm": 40, "height_mm": 29.6}


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
    assert reduced.experiments() == whole.experiments()
    assert reduced.cases() == whole.cases()
    assert reduced.results_dir == "results/ci"
    assert sum(reduced.simulation_case(CENTRE, "a", 1)["particles"]["counts"]) == 900


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
        ("hopper.outlet_radius_mm", "wide", "a number above 0"),
        ("hopper.outlet_radius_mm", True, "a number above 0"),
        ("hopper.outlet_radius_mm", None, "a number above 0"),
        ("hopper.outlet_radius_mm", [22.5], "a number above 0"),
        ("hopper.outlet_radius_mm", float("nan"), "a number above 0"),
        ("hopper.outlet_radius_mm", float("inf"), "a number above 0"),
        ("hopper.outlet_radius_mm", ".inf", "a number above 0"),
        ("hopper.outlet_radius_mm", 10**400, "a number above 0"),
        ("hopper.outlet_radius_mm", "9" * 5000, "a number above 0"),
        ("hopper.outlet_radius_mm", "22,5", "a number above 0"),
        ("hopper.half_angle_deg", 91, "a number above 0 and at most 90"),
        ("particles.density_kg_m3", -2285, "a number above 0"),
        ("wall.shear_modulus_pa", "-.inf", "a number above 0 or .inf"),
        ("wall.poisson_ratio", 0.6, "a number at least 0 and at most 0.5"),
        ("contact.particle.restitution", 1.1, "a number at least 0 and at most 1"),
        ("contact.rolling", "EDEM", "edem, cdt or none"),
        ("insert.shape", "cube", "cone, profile or none"),
        ("insert.shape", None, "cone, profile or none"),
        ("discharge.sensor_mm", 12, "a number below 0"),
        ("simulation.time_step_s", "automatic", "a number above 0 or auto"),
        ("simulation.time_step_s", True, "a number above 0 or auto"),
        ("filling.particles", 1000, "null or a multiple of 3"),
        ("filling.particles", 900.5, "a whole number at least 3 and at most 1e+07 or null"),
        ("filling.level_mm", -1, "a number above 0"),
        ("surrogate.starts", 0, "a whole number at least 1"),
        ("surrogate.starts", "many", "a whole number at least 1"),
        ("surrogate.selected_hidden_nodes", "best", "a whole number at least 1 or auto"),
        ("surrogate.hidden_nodes", [], "at least 1 entries"),
        ("surrogate.hidden_nodes", 7, "a list"),
        ("design.sobol.experiments", 25, "a power of two"),
        ("seed", -1, "a whole number at least 0"),
        ("results_dir", "", "the path of a folder"),
        ("results_dir", "results/{study}", "the path of a folder"),
        ("results_dir", 5, "text"),
        ("insert", None, "the keys shape, height_mm, cone, profile"),
        ("insert.cone", 55, "the keys slope_deg, length_mm"),
        ("factors.theta_deg", 55, "the keys key, levels"),
        ("factors", ["theta_deg"], "keys with their values"),
        ("verification.cases.middle", "centre", "selected, plan_centre, bare, or a number for each factor"),
    ],
)
def test_value_that_is_not_allowed(key, value, allowed):
    line = only(nested(key, value))
    assert line.startswith(f"{key}: {document.shown(value)} is not allowed; allowed: ")
    assert allowed in line


def test_diameters():
    for wrong in ([2, -3, 4], [2, 3, 0], [2, float("nan"), 4], [2, "x", 4]):
        assert "a number above 0" in only({"particles": {"diameters_mm": wrong}})
    for wrong in ([2, 3], [4, 3, 2], [1, 2, 3, 4], []):
        assert "three diameters, ascending or equal" in only({"particles": {"diameters_mm": wrong}})
    config.parse({"particles": {"diameters_mm": [3, 3, 3]}})


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
