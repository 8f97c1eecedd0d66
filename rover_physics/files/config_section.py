"""One section of a configuration file: typed look-ups whose errors name the dotted key."""

import difflib
import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

from rover_physics.errors import RoverFileError


class ConfigSection:
    """A mapping of known keys at a place of a configuration file.

    Args:
        data: The mapping as read.
        source: File name or other origin, opens every error text.
        path: Dotted key of the section, empty for the whole file.
        required: Keys that must be there.
        optional: Keys that may be there.
        kind: What the whole file is, for error texts.

    Raises:
        RoverFileError: Not a mapping, or a key is unknown or missing.
    """

    def __init__(
        self,
        data: object,
        source: str,
        path: str,
        required: Sequence[str],
        optional: Sequence[str] = (),
        kind: str = "a rover file",
    ) -> None:
        self._source = source
        self._path = path
        self._kind = kind
        if not isinstance(data, Mapping):
            where = path or "the file"
            keys = ", ".join(required)
            raise RoverFileError(
                f"{source}: {where} is {describe(data)}; it must be a mapping with {keys}"
            )
        self._data: Mapping[Any, Any] = data
        self._check_keys(required, optional)

    def key(self, name: str) -> str:
        """Return the dotted key of one entry."""
        return f"{self._path}.{name}" if self._path else name

    def error(self, name: str, must: str) -> RoverFileError:
        """Build the error for an impossible value; ``must`` says what would be right."""
        return RoverFileError(
            f"{self._source}: {self.key(name)} is {describe(self._data[name])}; it must be {must}"
        )

    def has(self, name: str) -> bool:
        """Tell whether an optional key is there and not null."""
        return self._data.get(name) is not None

    def section(
        self, name: str, required: Sequence[str], optional: Sequence[str] = ()
    ) -> "ConfigSection":
        """Return the section below a key."""
        return ConfigSection(self._data[name], self._source, self.key(name), required, optional)

    def sections(
        self, name: str, required: Sequence[str], optional: Sequence[str] = ()
    ) -> "list[ConfigSection]":
        """Return the sections of a list below a key, one at least."""
        items = self._data[name]
        if not isinstance(items, list) or not items:
            raise self.error(name, "a list of one mapping or more")
        return [
            ConfigSection(item, self._source, f"{self.key(name)}[{k}]", required, optional)
            for k, item in enumerate(items)
        ]

    def number(
        self,
        name: str,
        unit: str,
        *,
        above: float | None = None,
        least: float | None = None,
        most: float | None = None,
    ) -> float:
        """Return a finite number within the bounds; ``above`` itself is outside."""
        must = _number_phrase(unit, above, least, most)
        value = self._finite(name, self._data[name], must)
        too_low = (above is not None and value <= above) or (least is not None and value < least)
        if too_low or (most is not None and value > most):
            raise self.error(name, must)
        return value

    def numbers(self, name: str, count: int, unit: str) -> tuple[float, ...]:
        """Return a list of ``count`` finite numbers."""
        must = f"a list of {count} numbers in {unit}"
        return tuple(self._finite(name, item, must) for item in self._items(name, count, must))

    def point(self, name: str) -> tuple[float, float, float]:
        """Return a position [x, y, z] in the body frame, in m."""
        x, y, z = self.numbers(name, 3, "m, [x, y, z] in the body frame")
        return (x, y, z)

    def interval(self, name: str, unit: str) -> tuple[float, float]:
        """Return [lowest, highest] with the first below the second."""
        low, high = self.numbers(name, 2, f"{unit}, [lowest, highest]")
        if not low < high:
            raise self.error(name, f"[lowest, highest] in {unit}, the first below the second")
        return (low, high)

    def intervals(self, name: str, count: int, unit: str) -> tuple[tuple[float, float], ...]:
        """Return a list of ``count`` intervals [lowest, highest], each first below its second."""
        must = f"a list of {count} intervals [lowest, highest] in {unit}"
        found = []
        for item in self._items(name, count, must):
            if not isinstance(item, Sequence) or isinstance(item, str) or len(item) != 2:
                raise self.error(name, must)
            low, high = (self._finite(name, end, must) for end in item)
            if not low < high:
                raise self.error(name, must)
            found.append((low, high))
        return tuple(found)

    def text(self, name: str) -> str:
        """Return a text that is not empty."""
        value = self._data[name]
        if not isinstance(value, str) or not value.strip():
            raise self.error(name, "a text that is not empty")
        return value

    def texts(self, name: str, count: int) -> tuple[str, ...]:
        """Return a list of ``count`` different texts, none of them empty."""
        must = f"a list of {count} different names"
        items = self._items(name, count, must)
        if not all(isinstance(item, str) and item.strip() for item in items):
            raise self.error(name, must)
        if len(set(items)) != count:
            raise self.error(name, must)
        return tuple(items)

    def names(self, name: str) -> tuple[str, ...]:
        """Return a list of one text or more, all different, none of them empty."""
        items = self._data[name]
        if not isinstance(items, list) or not items:
            raise self.error(name, "a list of one name or more")
        return self.texts(name, len(items))

    def choice(self, name: str, choices: Sequence[str]) -> str:
        """Return a text that is one of the choices."""
        value = self._data[name]
        if not isinstance(value, str) or value not in choices:
            raise self.error(name, " or ".join(choices))
        return value

    def _items(self, name: str, count: int, must: str) -> list[Any]:
        value = self._data[name]
        is_list = isinstance(value, Sequence) and not isinstance(value, str | bytes)
        items = value.tolist() if hasattr(value, "tolist") else list(value) if is_list else None
        if not isinstance(items, list) or len(items) != count:
            raise self.error(name, must)
        return items

    def _finite(self, name: str, value: object, must: str) -> float:
        if isinstance(value, str) and _is_numeric(value):
            raise self.error(
                name,
                f"{must}; YAML reads {value!r} as text: leave the quotes out, and write an "
                "exponent with a decimal point and a sign, as in 1.0e-3 or 1.0e+3",
            )
        if isinstance(value, bool) or not isinstance(value, Real):
            raise self.error(name, must)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(name, must)
        return number

    def _check_keys(self, required: Sequence[str], optional: Sequence[str]) -> None:
        known = (*required, *optional)
        place = self._path or self._kind
        for key in self._data:
            if key in known:
                continue
            close = difflib.get_close_matches(str(key), known, n=1)
            hint = f"did you mean {close[0]}? " if close else ""
            raise RoverFileError(
                f"{self._source}: unknown key {self.key(str(key))}; {hint}"
                f"{place} has {', '.join(known)}"
            )
        for key in required:
            if key not in self._data:
                raise RoverFileError(
                    f"{self._source}: missing key {self.key(key)}; {place} needs "
                    f"{', '.join(required)}"
                )


def describe(value: object) -> str:
    """Describe a value of a file briefly, as its writer would recognise it."""
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _number_phrase(unit: str, above: float | None, least: float | None, most: float | None) -> str:
    """Say in words what a number with these bounds must be."""
    bounds = []
    if above is not None:
        bounds.append(f"above {above:g}")
    if least is not None:
        bounds.append(f"at least {least:g}")
    if most is not None:
        bounds.append(f"at most {most:g}")
    return " ".join(filter(None, ("a number", " and ".join(bounds), f"in {unit}" if unit else "")))


def _is_numeric(text: str) -> bool:
    """Tell whether a text would be a number to Python."""
    try:
        float(text)
    except ValueError:
        return False
    return True
