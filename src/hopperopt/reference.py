"""The configuration for editors and readers, made from its models: JSON schema, and a page of every key."""

import functools
import json
from collections.abc import Iterator, Mapping

from hopperopt import config, units
from hopperopt.document import lookup
from hopperopt.quantity import Quantity

HEADING = """\
# Every key of the configuration

Made by `make reference` from the models in `src/hopperopt/config/`, as is `config/config.schema.json`,
which tells editors the same. [config/README.md](../config/README.md) says how files are merged and checked.
NAME stands for a name of your own.
"""


def schema() -> str:
    """Text of the JSON schema."""
    return json.dumps(_json_schema(), indent=2, ensure_ascii=False) + "\n"


def page() -> str:
    """Text of the page: a table for each section, a row for each key."""
    made, text, single = _json_schema(), HEADING, []
    for name, entry in made["properties"].items():
        rows = list(_rows(made, name, entry))
        if rows[0][0] == name:
            single += rows
        else:
            text += _table(f"`{name}`", _about(made, entry), rows)
    return text + _table("Single keys", "At the top level.", single)


def _json_schema() -> dict:
    """JSON schema of a document, an override included: no key is required, entries by name may be null."""
    made = config.Study.model_json_schema()
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


def _or_null(entry: dict, by_pattern: bool) -> dict:
    """The schema of an entry by name that null leaves out."""
    if by_pattern:
        return {pattern: _or_null(each, False) for pattern, each in entry.items()}
    return {"anyOf": [entry, {"type": "null"}]}


def _about(made: Mapping, entry: Mapping) -> str:
    return entry.get("description") or _section(made, entry)["description"]


def _section(made: Mapping, entry: Mapping) -> dict:
    """The model that an entry refers to, empty for a value."""
    return made["$defs"][entry["$ref"].rpartition("/")[2]] if "$ref" in entry else {}


def _rows(made: Mapping, key: str, entry: Mapping) -> Iterator[tuple[str, str, str, str, str]]:
    """Key, unit, default, what is allowed and meaning of an entry, or of all below it."""
    if model := _section(made, entry):
        for name, below in model["properties"].items():
            yield from _rows(made, f"{key}.{name}", below)
    elif "patternProperties" in entry:
        (below,) = entry["patternProperties"].values()
        value = below["anyOf"][0]
        if "$ref" in value:
            yield from _rows(made, f"{key}.NAME", value)
        else:
            default = ", ".join(f"`{name}`" for name in entry.get("default", {}))
            yield f"{key}.NAME", "", default, _allowed(below), entry["description"]
    else:
        yield key, _unit(key), _default(key), _allowed(entry), entry["description"]


def _unit(key: str) -> str:
    return units.split(key.rpartition(".")[2])[1].words.strip()


@functools.cache
def _defaults() -> dict:
    return config.parse({}).document


def _default(key: str) -> str:
    try:
        return _shown(lookup(_defaults(), key))
    except LookupError:  # below a name of one's own
        return ""


def _shown(value) -> str:
    if value is None:
        return "null"
    if isinstance(value, str):
        return f"`{value}`"
    if isinstance(value, float):
        return f"{value:g}"
    return f"`{json.dumps(value)}`" if isinstance(value, dict | list | tuple) else str(value)


def _allowed(entry: Mapping) -> str:
    """What is allowed, in the words of the mistakes."""
    kinds = entry.get("anyOf", [entry])
    words = [None if kind.get("type") == "null" else kind.get("const") for kind in kinds]
    words = [word for kind, word in zip(kinds, words, strict=True) if word or kind.get("type") == "null"]
    for kind in kinds:
        if kind.get("type") in ("number", "integer"):
            quantity = Quantity(
                above=kind.get("exclusiveMinimum"),
                least=kind.get("minimum"),
                below=kind.get("exclusiveMaximum"),
                most=kind.get("maximum"),
            )
            return quantity.described(kind["type"] == "integer", words)
    said = [_kind(kind) for kind in kinds if not kind.get("const") and kind.get("type") != "null"]
    return " or ".join([*said, *(word or "null" for word in words)])


def _kind(kind: Mapping) -> str:
    if "enum" in kind:
        return ", ".join(kind["enum"])
    if "anyOf" in kind:
        return _allowed(kind)
    if kind["type"] == "array":
        if "prefixItems" in kind:
            return f"a list of {len(kind['prefixItems'])}: each {_allowed(kind['prefixItems'][0])}"
        ends = {"at least": kind.get("minItems"), "at most": kind.get("maxItems")}
        count = " and ".join(f"{word} {number}" for word, number in ends.items() if number is not None)
        return f"a list{f' of {count}' if count else ''}: each {_allowed(kind['items'])}"
    return {"string": "text", "object": "a number for each factor"}[kind["type"]]


def _table(title: str, about: str, rows) -> str:
    head = "| key | unit | default | allowed | meaning |\n|---|---|---|---|---|\n"
    lines = "".join(f"| `{key}` | {' | '.join(rest)} |\n" for key, *rest in rows)
    return f"\n## {title}\n\n{about}\n\n{head}{lines}"
