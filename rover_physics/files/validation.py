# SPDX-License-Identifier: Apache-2.0
"""Validation of the contents of a configuration file; each error names the dotted key."""

import difflib
import math
import reprlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

from rover_physics.errors import RoverError, RoverFileError
from rover_physics.files.rules import Rule, number
from rover_physics.numerics.plausible import MAX_COORDINATE

if TYPE_CHECKING:
    from pydantic import TypeAdapter

UNKNOWN_KEY = ("unexpected_keyword_argument", "extra_forbidden", "invalid_key")
"""Error types of pydantic for unknown keys."""
MISSING_KEY = "missing"
RULE_BROKEN = "rule"
KEY_ITSELF = "[key]"
"""Last part of pydantic's place of an error about a key that must be a text."""
MAX_SHOWN = 60
"""Largest number of characters of a value or key in an error text."""
MAX_FILE_SHOWN = 150
"""Largest number of characters of a file's name in an error text."""
ANY_NUMBER = number("", least=-MAX_COORDINATE, most=MAX_COORDINATE)
"""Rule of a number that may be anything a model can compute with."""
Key = tuple[str | int, ...]

_brief = reprlib.Repr()
_brief.maxlevel = 3
_brief.maxstring = _brief.maxother = 200


def read_as(kind: Any, data: object, what: str, at: Key = ()) -> Any:
    """Return the contents of a file, or of a part of it, as a type.

    Args:
        kind: A dataclass or another type whose annotations have the rules of its keys.
        data: The contents as read from YAML.
        what: Kind of the whole file for error texts, such as "a rover file".
        at: Key of the part within the file.

    Raises:
        RoverFileError: A key is missing, unknown or invalid; the text names the dotted key, the
            value and the rule.
    """
    from pydantic import ValidationError

    try:
        return _adapter(kind).validate_python(data, extra="forbid")
    except ValidationError as error:
        faults = error.errors(include_url=False, include_context=False)
    # A misspelt key is both unknown and missing; the error of the unknown key has a suggestion.
    order = (*UNKNOWN_KEY, MISSING_KEY)
    first = min(faults, key=lambda fault: (fault["type"] not in order, fault["type"] == order[-1]))
    missing = [show_key((*at, *one["loc"])) for one in faults if one["type"] == MISSING_KEY]
    if first["type"] == MISSING_KEY and len(missing) > 1:
        raise RoverFileError(f"missing keys {', '.join(missing)}; {what} needs all of them")
    raise RoverFileError(_describe_fault(kind, first, what, at))


@cache
def find_rule(kind: Any, key: Key) -> Rule:
    """Return the rule of the number at a key of a type; that of any number if it has none."""
    rule: Rule = _part(kind, key).get("rule", ANY_NUMBER)
    return rule


def refuse(key: str, value: object, must: str) -> RoverFileError:
    """Return the error for an invalid value; `must` states the rule."""
    return RoverFileError(f"{key} is {describe(value)}; it must be {must}")


@contextmanager
def errors_of(source: object, kind: type[RoverError] = RoverFileError) -> Iterator[None]:
    """Put the name of a file before the text of each RoverFileError."""
    try:
        yield
    except RoverFileError as error:
        raise kind(f"{show_file(source)}: {error}") from None


def show_file(name: object) -> str:
    """Return the name of a file as an error shows it: printable, and cut in the middle if long."""
    text = str(name)
    text = text if text.isprintable() else ascii(text)[1:-1]
    half = MAX_FILE_SHOWN // 2
    return text if len(text) <= MAX_FILE_SHOWN else f"{text[:half]}...{text[-half:]}"


def suggest(name: str, known: Sequence[str]) -> str:
    """Return "did you mean ...? " with the nearest known name, empty if none is near."""
    close = difflib.get_close_matches(name[:MAX_SHOWN], known, n=1)
    return f"did you mean {close[0]}? " if close else ""


def describe(value: object, most: int = MAX_SHOWN) -> str:
    """Describe a value of a file in one line of at most `most` characters."""
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return "true" if value else "false"
    try:
        text = _brief.repr(list(value) if isinstance(value, tuple) else value)
    except ValueError:  # Python refuses to write thousands of digits
        text = "a number of too many digits"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def show_key(key: Key) -> str:
    """Return a key as it is written, such as drives[0].length."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{_show_part(part)}" for part in key)
    return "".join(parts).lstrip(".")


def _show_part(part: str) -> str:
    return part if part.isidentifier() and len(part) <= MAX_SHOWN else describe(part).strip("'\"")


@cache
def _adapter(kind: Any) -> "TypeAdapter[Any]":
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


@cache
def _json_schema(kind: Any) -> dict[str, Any]:
    return _adapter(kind).json_schema()


def _describe_fault(kind: Any, fault: Any, what: str, at: Key) -> str:
    """Return one line about a fault that pydantic has found."""
    found, place = fault["loc"], fault["loc"][:-1]
    key = show_key((*at, *found))
    if fault["type"] == RULE_BROKEN:
        return str(refuse(key, fault["input"], fault["msg"] + _hint(fault)))
    if fault["type"] not in (*UNKNOWN_KEY, MISSING_KEY):
        part = _part(kind, found)
        must = fault["msg"].removeprefix("Input should be ")
        if "properties" in part:
            must = f"a mapping with {', '.join(_names(part))}"
        return str(refuse(key or "the file", fault["input"], must))
    where, part = show_key((*at, *place)) or what, _part(kind, place)
    if fault["type"] == MISSING_KEY:
        return f"missing key {key}; {where} needs {', '.join(_names(part))}"
    # A mapping without keys stands for what is told elsewhere, such as `Limits.further`.
    known = [key for key, inner in part["properties"].items() if inner.get("properties") != {}]
    name = str(found[-1])
    key, hint = show_key((*at, *place, name)), suggest(name, known)
    return f"unknown key {key}; {hint}{where} has {', '.join(known)}"


def _hint(fault: Any) -> str:
    """Return a hint for a number that YAML reads as text."""
    value = fault["input"]
    items = value if isinstance(value, list) else [value]
    if "number" not in fault["msg"] or not any(map(_is_number_as_text, items)):
        return ""
    return (
        "; YAML reads it as text: leave the quotes out, and write an exponent with a decimal "
        "point and a sign, as in 1.0e-3 or 1.0e+3"
    )


def _is_number_as_text(value: object) -> bool:
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def _names(part: dict[str, Any]) -> Sequence[str]:
    """Return the required keys of a mapping, or its optional keys if none is required."""
    return part.get("required") or tuple(part["properties"])


def _part(kind: Any, key: Key) -> dict[str, Any]:
    """Return the JSON schema at a key of a type."""
    schema = _json_schema(kind)
    part = _resolve(schema, schema)
    for name in key:
        if name == KEY_ITSELF:
            return {}
        if "additionalProperties" in part and "properties" not in part:  # keys of any name
            inner = part["additionalProperties"]
            if not isinstance(inner, dict):
                return {}
        elif isinstance(name, str):
            inner = part["properties"].get(name, {})
        else:
            inner = part["prefixItems"][name] if "prefixItems" in part else part["items"]
        part = _resolve(inner, schema)
    return part


def _resolve(part: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    """Return a part of a JSON schema with references resolved; "X or null" becomes X."""
    part = part["anyOf"][0] if "anyOf" in part else part
    return schema["$defs"][part["$ref"].rsplit("/", 1)[1]] if "$ref" in part else part
