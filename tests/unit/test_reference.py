"""The configuration's schema and page of keys are those of the models, and say what the models do."""

import json
import math
import re
from pathlib import Path

import pytest
import yaml

from hopperopt import config, document, reference
from hopperopt.mistakes import sentences

ROOT = Path(__file__).parents[2]
MULTIPLES = {"filling.particles", "design.sobol.experiments"}  # not every number within the bounds
SCHEMA, PAGE = ROOT / "config/config.schema.json", ROOT / "docs/configuration.md"


def leaves(schema, entry):
    """Every value of the schema, with the names on its way."""
    if "$ref" in entry:
        entry = schema["$defs"][entry["$ref"].rpartition("/")[2]]
    if "properties" not in entry:
        yield (), entry
    for name, below in entry.get("properties", {}).items():
        for path, leaf in leaves(schema, below):
            yield (name, *path), leaf


@pytest.fixture(scope="module")
def schema():
    return json.loads(reference.schema())


@pytest.mark.parametrize(("path", "made"), [(SCHEMA, reference.schema), (PAGE, reference.page)])
def test_files_are_those_of_the_models(path, made):
    assert path.read_text(encoding="utf-8") == made(), f"{path.name} is old: make reference"


def test_every_key_has_a_meaning_and_a_row(schema):
    rows = re.findall(r"^\| `([^`]+)`", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    known = dict(leaves(schema, schema))
    assert [path for path, leaf in known.items() if not leaf.get("description")] == []
    named = {re.sub(r"\.NAME.*", "", row) for row in rows}
    assert named == {".".join(path) for path in known}
    plain = {key for key in document.dotted_keys(config.parse({}).document) if not re.search(r"\.\d+$", key)}
    entries = ("factors.", "verification.cases.", "verification.replicates_of.")
    assert {key for key in plain if not key.startswith(entries)} <= named


def test_schema_has_the_bounds_that_the_models_enforce(schema):
    """At each bound of a number a value is allowed, and none beyond it."""
    checked = 0
    for path, leaf in leaves(schema, schema):
        kinds = [kind for kind in leaf.get("anyOf", [leaf]) if kind.get("type") in ("number", "integer")]
        key = ".".join(path)
        if not kinds or key in MULTIPLES:
            continue
        for bound, outwards in (("minimum", -1), ("maximum", 1)):
            if abs(kinds[0].get(bound, math.inf)) > 2**53:  # no bound, or none that a float holds
                continue
            value = kinds[0][bound]
            step = 1 if kinds[0]["type"] == "integer" else 1e-9 * max(1, abs(value))
            outside = value + outwards * step
            assert said(path, value) == ""
            assert f"{key}: {json.dumps(outside)} is not allowed" in said(path, outside)
            checked += 1
    assert checked > 60


def test_rigid_wall_is_no_mistake_to_an_editor(schema):
    """.inf is allowed, so the schema cannot have a maximum there."""
    rigid = dict(leaves(schema, schema))["wall", "shear_modulus_pa"]
    assert said(("wall", "shear_modulus_pa"), math.inf) == ""
    assert "maximum" not in rigid and "exclusiveMaximum" not in rigid and rigid["minimum"] == 1000


def said(path, value):
    """What is wrong with a document of one value, for its key alone."""
    for part in reversed(path):
        value = {part: value}
    try:
        config.Study.model_validate(value)
    except ValueError as error:
        return "\n".join(sentences(error.errors(include_url=False), config.Study))
    return ""


def test_examples_keep_to_the_keys_of_the_schema(schema):
    known = set(dict(leaves(schema, schema)))
    for path in [ROOT / "config.yaml", *(ROOT / "config").rglob("*.yaml")]:
        for key in document.dotted_keys(yaml.safe_load(path.read_text(encoding="utf-8"))):
            parts = tuple(key.split("."))
            assert any(parts[:length] in known for length in range(1, len(parts) + 1)), (path.name, key)


def test_editors_find_the_schema():
    first = (ROOT / "config.yaml").read_text(encoding="utf-8").splitlines()[0]
    assert first == "# yaml-language-server: $schema=config/config.schema.json"
