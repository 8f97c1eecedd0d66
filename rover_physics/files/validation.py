# SPDX-License-Identifier: Apache-2.0
"""Validation of the contents of a configuration file; each error names the dotted key."""

import difflib
import math
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import MISSING as NO_DEFAULT
from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from rover_physics.errors import RoverError, RoverFileError
from rover_physics.files.rules import Keys, ListOfMappings, Rule

MAX_SHOWN = 60
"""Largest number of characters of a value or key in an error text."""
MAX_FILE_SHOWN = 150
"""Largest number of characters of a file's name in an error text."""
UNKNOWN, MISSING, WRONG = range(3)
"""Kinds of faults; those of the first kind are told first."""
PLAIN = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
"""Types of single values, and the words for them."""
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
    reader = _Reader(what)
    contents = reader.read(kind, data, at)
    if not reader.faults:
        return contents
    # A misspelt key is both unknown and missing; the error of the unknown key has a suggestion.
    kind_of_fault, text = min(reader.faults, key=lambda fault: fault[0])
    if kind_of_fault == MISSING and len(reader.missing) > 1:
        raise RoverFileError(f"missing keys {', '.join(reader.missing)}; {what} needs all of them")
    raise RoverFileError(text)


def find_unit(kind: Any, key: Key) -> str:
    """Return the unit of the number at a key of a type, empty if it has none."""
    for name in key:
        kind, marks = _split(kind)
        keys, parts = _keys_of(kind, marks), get_args(kind)
        if keys is not None:
            kind = keys.all[str(name)]
        else:
            kind = parts[0] if parts[-1] is Ellipsis else parts[int(name)]
    return next((mark.unit for mark in _split(kind)[1] if isinstance(mark, Rule)), "")


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
def _keys_of_dataclass(kind: Any) -> Keys:
    hints = get_type_hints(kind, include_extras=True)
    required, optional = dict[str, Any](), dict[str, Any]()
    for one in fields(kind):
        is_required = one.default is NO_DEFAULT and one.default_factory is NO_DEFAULT
        (required if is_required else optional)[one.name] = hints[one.name]
    return Keys(required, optional)


def _keys_of(kind: Any, marks: Sequence[Any]) -> Keys | None:
    """Return the keys of a mapping whose keys are known, None for another type."""
    if isinstance(kind, type) and is_dataclass(kind):
        return _keys_of_dataclass(kind)
    return next((mark for mark in marks if isinstance(mark, Keys)), None)


def _split(kind: Any) -> tuple[Any, Sequence[Any]]:
    """Return a type without its marks and without "or None", and the marks."""
    if get_origin(kind) in (Union, UnionType):
        kind = next(one for one in get_args(kind) if one is not NoneType)
    if get_origin(kind) is Annotated:
        kind, *marks = get_args(kind)
        return kind, marks
    return kind, ()


class _Reader:
    """Reads contents as types, and collects what is wrong with them."""

    def __init__(self, what: str):
        self._what = what
        self.faults: list[tuple[int, str]] = []
        """Kind and text of each."""
        self.missing: list[str] = []
        """The missing keys."""

    def read(self, kind: Any, value: Any, key: Key) -> Any:
        """Return a value as a type; after a fault, anything."""
        if value is None and NoneType in get_args(kind):
            return None
        kind, marks = _split(kind)
        for mark in marks:
            if isinstance(mark, Rule):
                return self._read_by_rule(kind, mark, value, key)
            if isinstance(mark, ListOfMappings) and not (isinstance(value, list) and value):
                return self._refuse(key, value, "a list of one mapping or more")
        keys = _keys_of(kind, marks)
        if keys is not None:
            contents = self._read_keys(keys, value, key)
            return kind(**contents) if not self.faults else contents
        if get_origin(kind) is tuple:
            return self._read_tuple(get_args(kind), value, key)
        if get_origin(kind) in (dict, Mapping):
            return self._read_mapping(get_args(kind)[1], value, key)
        return value if kind is Any else self._read_plain(kind, value, key)

    def _read_by_rule(self, kind: Any, rule: Rule, value: Any, key: Key) -> Any:
        """Return a value that keeps a rule, of which alone the error tells."""
        inner = _Reader(self._what)
        found = inner.read(kind, value, key)
        if inner.faults or not rule.holds(found):
            return self._refuse(key, value, rule.must)
        return found

    def _read_keys(self, keys: Keys, value: Any, key: Key) -> dict[str, Any]:
        known, where = tuple(keys.all), show_key(key) or self._what
        needed = ", ".join(keys.required or known)
        if not isinstance(value, dict):
            return self._refuse(key, value, f"a mapping with {needed}")
        found = {}
        for name, kind in keys.all.items():
            if name in value:
                found[name] = self.read(kind, value[name], (*key, name))
            elif name in keys.required:
                missing = show_key((*key, name))
                self.missing.append(missing)
                self.faults.append((MISSING, f"missing key {missing}; {where} needs {needed}"))
        for name in (name for name in value if name not in keys.all):
            unknown, hint = show_key((*key, str(name))), suggest(str(name), known)
            text = f"unknown key {unknown}; {hint}{where} has {', '.join(known)}"
            self.faults.append((UNKNOWN, text))
        return found

    def _read_mapping(self, kind: Any, value: Any, key: Key) -> Any:
        if not isinstance(value, dict):
            return self._refuse(key, value, "a mapping")
        for name in value:
            if not isinstance(name, str):
                text = f"a key of {show_key(key) or self._what}"
                self.faults.append((WRONG, str(refuse(text, name, "a text"))))
        return {name: self.read(kind, one, (*key, name)) for name, one in value.items()}

    def _read_tuple(self, kinds: tuple[Any, ...], value: Any, key: Key) -> Any:
        items = value.tolist() if hasattr(value, "tolist") else value
        if not isinstance(items, list | tuple):
            return self._refuse(key, value, "a list")
        kinds = kinds[:1] * len(items) if kinds[-1] is Ellipsis else kinds
        if len(items) != len(kinds):
            return self._refuse(key, value, f"a list of {len(kinds)}")
        pairs = enumerate(zip(kinds, items, strict=True))
        return tuple(self.read(kind, item, (*key, k)) for k, (kind, item) in pairs)

    def _read_plain(self, kind: Any, value: Any, key: Key) -> Any:
        """Return a single value; a whole number will do for a number, but no bool for either."""
        kinds = (int, float) if kind is float else kind
        if isinstance(value, kinds) and isinstance(value, bool) == (kind is bool):
            with suppress(OverflowError):
                return kind(value)
        return self._refuse(key, value, PLAIN[kind])

    def _refuse(self, key: Key, value: object, must: str) -> Any:
        text = str(refuse(show_key(key) or "the file", value, must + _hint(value, must)))
        self.faults.append((WRONG, text))


def _hint(value: object, must: str) -> str:
    """Return a hint for a number that YAML reads as text."""
    items = value if isinstance(value, list) else [value]
    if "number" not in must or not any(map(_is_number_as_text, items)):
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
