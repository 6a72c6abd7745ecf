"""Configuration documents: reading and merging files, dotted keys, and the mistakes found in them."""

import json
import re
from collections.abc import Mapping
from pathlib import Path

import yaml

NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
NOT_IN_TENS = re.compile(r"[+-]?(0[\d_]+|.*:.*)")


class ConfigError(ValueError):
    """A configuration cannot be used; the message has one line for each mistake."""


class NotAllowed(ValueError):
    """One value is refused; the text says what is allowed in its place."""


def mistake(key, value, allowed):
    """The sentence for one mistake: dotted key, the value found, what is allowed."""
    return f"{key}: {shown(value)} is not allowed; allowed: {allowed}"


def shown(value):
    """A value as it would be typed, on one line of at most 60 characters."""
    try:
        text = json.dumps(value, ensure_ascii=False, default=str)
    except (TypeError, ValueError):
        text = repr(value)
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:60])
    return text if len(text) < 60 else text[:57] + "..."


def load(paths, overrides=None):
    """The raw document of several files, later ones merged over earlier ones as Snakemake merges them."""
    document = {}
    for path in paths:
        try:
            merge(document, _read(Path(path)))
        except RecursionError:  # a YAML anchor inside itself
            raise ConfigError(f"{path}: holds a section that contains itself") from None
    return merge(document, overrides or {})


def _read(path):
    """One JSON or YAML file as a dict (JSON is tried first, as Snakemake does)."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not text in UTF-8") from None
    try:
        document = json.loads(text, object_pairs_hook=_distinct)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    except ValueError:
        document = _yaml(path, text)
    if not isinstance(document, dict):
        raise ConfigError(f"{path}: holds no keys; allowed: a YAML or JSON file with keys at its top level")
    return document


def _distinct(pairs):
    """The dict of a JSON object's pairs; ConfigError when a key is there twice."""
    document = {}
    for key, value in pairs:
        if key in document:
            raise ConfigError(f"{key}: is there twice")
        document[key] = value
    return document


def _yaml(path, text):
    try:
        document = yaml.safe_load(text)
        found = [f"{path}, {sentence}" for sentence in _misread(yaml.compose(text, yaml.SafeLoader))]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = " ".join(str(getattr(error, "problem", None) or error).split())
        raise ConfigError(f"{path}{where}: is not valid YAML ({problem})") from None
    except ValueError as error:  # a date such as 2024-13-45
        raise ConfigError(f"{path}: is not valid YAML ({error})") from None
    if found:
        raise ConfigError("\n".join(found))
    return document


def _misread(node, prefix=""):
    """Sentences where YAML silently takes what nobody means: of a key that is there twice the last value, and
    numbers that it does not read in tens (010 is 8, 1:30 is 90)."""
    line = f"line {node.start_mark.line + 1}: " if node else ""
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    yield f"line {key.start_mark.line + 1}: {prefix}{key.value}: is there twice"
                seen.add(key.value)
            yield from _misread(value, f"{prefix}{key.value}.")
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            yield from _misread(value, f"{prefix}{index}.")
    elif isinstance(node, yaml.ScalarNode) and node.tag in NUMBERS and NOT_IN_TENS.fullmatch(node.value):
        allowed = "a number without leading zeros and colons (YAML does not read this one in tens)"
        yield line + mistake(prefix.rstrip("."), node.value, allowed)


def merge(document, override):
    """Merge `override` into `document` and return it: dicts deep, anything else whole, nothing deleted.

    Same result as snakemake.utils.update_config, its corner included: an empty dict replaces nothing.
    """
    for key, value in override.items():
        if isinstance(value, Mapping):
            below = document.get(key, {})
            if value and not isinstance(below, Mapping):
                below = {}
            document[key] = merge(below, value)
        else:
            document[key] = value
    return document


def lookup(document, key):
    """The value at a dotted key (numbers index lists); LookupError when there is none."""
    value = document
    for part in key.split("."):
        try:
            value = value[int(part)] if isinstance(value, list | tuple) else value[part]
        except (ValueError, TypeError, KeyError, IndexError):
            raise LookupError(key) from None
    return value


def replaced(document, key, value):
    """A copy of a document with another value at a dotted key that exists."""
    part, _, rest = key.partition(".")
    if isinstance(document, list | tuple):
        copy, index = list(document), int(part)
    else:
        copy, index = dict(document), part
    copy[index] = replaced(copy[index], rest, value) if rest else value
    return copy


def dotted_keys(document, prefix=""):
    """Every dotted key of a document that holds a single value."""
    for key, value in document.items() if isinstance(document, Mapping) else enumerate(document):
        path = f"{prefix}{key}"
        if isinstance(value, Mapping | list | tuple):
            yield from dotted_keys(value, path + ".")
        else:
            yield path


def odd_keys(document, prefix=""):
    """Mistakes for keys that are no text on one line (YAML reads `on` and `1` as other things)."""
    for key, value in document.items():
        if not isinstance(key, str):
            yield mistake(f"{prefix}{shown(key)}", key, "a key that is text (quote it)")
        elif not key.isprintable():
            yield mistake(f"{prefix}{shown(key)}", key, "a key of letters, digits and underscores")
        elif isinstance(value, Mapping):
            yield from odd_keys(value, f"{prefix}{key}.")


def without_nulls(document, places):
    """A copy whose dicts at `places` (dotted keys) have lost the entries that an override set to null."""
    for place in places:
        try:
            entries = lookup(document, place)
        except LookupError:
            continue
        if isinstance(entries, Mapping):
            kept = {name: value for name, value in entries.items() if value is not None}
            document = replaced(document, place, kept)
    return document


def read_text(path):
    """Text of a file that a configuration names; raises NotAllowed when it cannot be read."""
    if not str(path).isprintable():
        raise NotAllowed("the path of a file, of printable characters")
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise NotAllowed(f"a file that can be read ({path}: {error.strerror})") from None
    except UnicodeDecodeError:
        raise NotAllowed(f"a text file in UTF-8 ({path} is not)") from None
