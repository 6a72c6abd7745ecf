"""Sentences for what pydantic finds wrong (its own name types, not what a person may type)."""

import difflib
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

from hopperopt.document import NotAllowed, mistake, shown

WORDS = {
    tuple: "a list",
    list: "a list",
    dict: "keys with their values",
    str: "text",
    float: "a number",
    int: "a whole number",
    Annotated: "text",
    type(None): "null",
}


def sentences(errors, model):
    """One sentence for each of pydantic's error dicts; `model` is the class of the whole document.

    A key that is missing because it is misspelt is said once, as the unknown key.
    """
    unknown = [error["loc"] for error in errors if error["type"] == "extra_forbidden"]
    misspelt = {(*path[:-1], name) for path in unknown for name in _nearest(path, model)}
    told = [error for error in errors if error["loc"] not in misspelt or error["type"] != "missing"]
    told = [error for error in told if not _long_enough(error)]
    return [_sentence(error, model) for error in told]


def _long_enough(error):
    """Whether a list is only called too short because some of its entries are wrong, which are told."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _sentence(error, model):
    path, kind, value = error["loc"], error["type"], error["input"]
    if path[-1] == "[key]" and kind != "extra_forbidden":  # pydantic's mark of a key that is not allowed
        path = path[:-1]
    key = ".".join(str(part) for part in path)
    if kind == "extra_forbidden":
        return _unknown(key, value, model, path)
    if kind == "missing":
        return f"{key}: is missing; allowed: {_expected(_annotation(model, path))}"
    refusal = error.get("ctx", {}).get("error")
    if isinstance(refusal, NotAllowed):
        return mistake(key, value, refusal)
    return mistake(key, value, _allowed(error, _annotation(model, path)))


def _unknown(key, value, model, path):
    """An unknown key: the nearest of the keys beside it, or of all keys, and what stands there."""
    known = list(_fields(_annotation(model, path[:-1])))
    near = _nearest(path, model)
    if not near:
        # The first of several keys of one name.
        everywhere = {name.rpartition(".")[2]: name for name in reversed(list(_all_keys(model)))}
        near = [
            everywhere[name] for name in difflib.get_close_matches(str(path[-1]), everywhere, n=1, cutoff=0.8)
        ]
    hint = f"did you mean {near[0]}? " if near else ""
    return f"{key}: unknown key (with {shown(value)}); {hint}allowed: {', '.join(known)}"


def _nearest(path, model):
    """The known key beside an unknown one that looks most like it, in a list; empty when none does."""
    known = list(_fields(_annotation(model, path[:-1])))
    return difflib.get_close_matches(str(path[-1]), known, n=1)


def _allowed(error, annotation):
    context = error.get("ctx", {})
    match error["type"]:
        case "literal_error":
            return context["expected"].replace("'", "")
        case "string_pattern_mismatch":
            return "small letters, digits and underscores, a letter first"
        case "too_short":
            return f"at least {context['min_length']} entries"
        case "too_long":
            return f"at most {context['max_length']} entries"
        case _:
            return _expected(annotation)


def _expected(annotation):
    """What kind of value an annotation asks for, in words."""
    if fields := _fields(annotation):
        return f"the keys {', '.join(fields)}"
    if get_origin(annotation) is Annotated:
        return _expected(annotation.__origin__)
    kinds = [get_origin(kind) or kind for kind in _alternatives(annotation)]
    return " or ".join(WORDS.get(kind, "another value") for kind in kinds)


def _fields(annotation):
    """Fields of the model that an annotation stands for, by name; none where it is no model."""
    for candidate in _alternatives(annotation):
        if hasattr(candidate, "model_fields"):
            return candidate.model_fields
    return {}


def _alternatives(annotation):
    if get_origin(annotation) is Annotated:
        return _alternatives(annotation.__origin__)
    return get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)


def _annotation(model, path):
    """The annotation at a path of keys; None where the path leaves the models."""
    annotation = model
    for part in path:
        fields = _fields(annotation)
        if part in fields:
            field = fields[part]
            annotation = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
        else:
            holders = [kind for kind in _alternatives(annotation) if get_origin(kind) in (dict, tuple, list)]
            annotation = get_args(holders[0])[1 if get_origin(holders[0]) is dict else 0] if holders else None
    return annotation


def _all_keys(model, prefix=""):
    for name, field in model.model_fields.items():
        yield prefix + name
        if hasattr(field.annotation, "model_fields"):
            yield from _all_keys(field.annotation, f"{prefix}{name}.")
