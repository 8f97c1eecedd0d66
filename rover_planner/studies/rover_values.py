# SPDX-License-Identifier: Apache-2.0
"""Numbers of a rover file: found by dotted names, such as belly.z, changed, and offered."""

import dataclasses
import difflib
import functools
import math
import operator
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from rover_physics.errors import RoverFileError
from rover_physics.files.validation import Key, describe, errors_of, find_rule
from rover_physics.files.yaml_file import parse_yaml
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict

AXES = ("x", "y", "z")
"""Names of the three numbers of a point."""


@dataclass(frozen=True)
class RoverValue:
    """One number of a rover file."""

    keys: tuple[Key, ...]
    """Keys in the file, such as ("wheel", "radius"); several if the values are always equal."""
    label: str
    """Label with unit."""
    low: float
    """Smallest value offered; the checks of the rover file may be stricter."""
    high: float
    """Largest value offered."""
    step: float
    """Smallest change."""


def list_values(rover: Rover) -> dict[str, list[RoverValue]]:
    """Return the changeable values of a rover, by part."""
    data = rover_to_dict(rover)
    span = abs(rover.suspension.wheels["front"][0])
    radius = rover.wheel.radius

    def length(label: str, *key: str | int, within: float) -> RoverValue:
        now = get_value(data, key)
        return _make_value((key,), f"{label} [m]", now, now - within, now + within)

    def amount(label: str, unit: str, *key: str | int, top: float = 0.0) -> RoverValue:
        now = get_value(data, key)
        return _make_value((key,), f"{label} [{unit}]", now, 0.2 * now, max(2.5 * now, top) or 1.0)

    height = length("wheels z", "suspension", "wheels", "rear", 2, within=1.5 * radius)
    all_wheels = tuple(("suspension", "wheels", name, 2) for name in WHEEL_POSITIONS)
    wheels = [
        length(f"{name} wheel x", "suspension", "wheels", name, 0, within=span)
        for name in WHEEL_POSITIONS
    ]
    values = {
        "Ground and drive": [
            amount("friction", "-", "friction"),
            amount("torque limit", "N m", "wheel", "max_torque"),
            amount("speed", "m/s", "nominal_speed"),
            amount("gravity", "m/s^2", "gravity"),
        ],
        "Links": [
            length("bogie pivot x", "suspension", "bogie_pivot", 0, within=span),
            length("bogie pivot z", "suspension", "bogie_pivot", 2, within=1.5 * radius),
            *wheels,
            dataclasses.replace(height, keys=all_wheels),
        ],
        "Wheels": [
            amount("radius", "m", "wheel", "radius"),
            amount("width", "m", "wheel", "width"),
        ],
        "Masses": [
            amount("body", "kg", "masses", "body", "mass"),
            length("body centre x", "masses", "body", "com", 0, within=span),
            length("body centre z", "masses", "body", "com", 2, within=2.0 * radius),
            amount("rocker", "kg", "masses", "rocker", "mass", top=1.0),
            amount("bogie", "kg", "masses", "bogie", "mass", top=1.0),
            amount("wheel", "kg", "wheel", "mass", top=1.0),
        ],
    }
    if rover.manipulator is not None:
        payload = amount("payload", "kg", "manipulator", "payload", top=0.4 * rover.total_mass)
        values["Masses"].append(payload)
    return values


def _make_value(
    keys: tuple[Key, ...], label: str, now: float, low: float, high: float
) -> RoverValue:
    """Return a value whose range contains `now` and has a few hundred one-digit steps."""
    step = 10.0 ** math.floor(math.log10(0.005 * (high - low)))
    low, high = math.floor(low / step + 0.01) * step, math.ceil(high / step - 0.01) * step
    return RoverValue(keys, label, round(min(low, now), 9), round(max(high, now), 9), step)


def find_key(contents: Mapping[str, Any], name: str) -> tuple[Key, str]:
    """Return the key and the unit of a number of a rover file.

    Args:
        contents: Contents of the rover file.
        name: Dotted name; numbers of a point are named x, y, z, other list items from 0.

    Raises:
        RoverFileError: There is no such number; the text lists the nearest names.
    """
    known = dict(_list_keys(contents))
    if name not in known:
        near = difflib.get_close_matches(name, known, 3) or sorted(known)[:3]
        raise RoverFileError(
            f"the rover has no number {describe(name)}; it has {', '.join(near)}, ..."
        )
    return known[name], find_rule(Rover, known[name]).unit


def _list_keys(contents: Any, name: str = "", key: Key = ()) -> Iterator[tuple[str, Key]]:
    if isinstance(contents, Mapping):
        for word, inner in contents.items():
            yield from _list_keys(inner, f"{name}.{word}" if name else word, (*key, word))
    elif isinstance(contents, list):
        for k, inner in enumerate(contents):
            is_point = len(contents) == 3 and key[-1] not in (
                "link_lengths",
                "link_masses",
                "stowed",
            )
            word = AXES[k] if is_point else str(k)
            yield from _list_keys(inner, f"{name}.{word}", (*key, k))
    elif isinstance(contents, int | float) and not isinstance(contents, bool):
        yield name, key


def get_value(data: Mapping[str, Any], key: Key) -> float:
    """Return a number from the contents of a rover file, by key."""
    return float(_follow(data, key))


def _follow(data: Any, key: Key) -> Any:
    return functools.reduce(operator.getitem, key, data)


def vary(rover: Rover, values: Mapping[Key, float]) -> Rover:
    """Return a copy of a rover with changed numbers, by key.

    Raises:
        RoverFileError: The changed rover is invalid; the text names the key.
    """
    data = rover_to_dict(rover)
    for key, value in values.items():
        _follow(data, key[:-1])[key[-1]] = float(value)
    return rover_from_dict(data, rover.name)


def write_rover(rover: Rover) -> str:
    """Return a rover as the text of a rover file."""
    return str(yaml.safe_dump(rover_to_dict(rover), sort_keys=False, default_flow_style=None))


def read_rover(text: str, source: str) -> Rover:
    """Read a rover from the text of a rover file.

    Raises:
        RoverFileError: The text is not YAML or the rover is invalid; the error names the key.
    """
    with errors_of(source):
        data = parse_yaml(text)
    return rover_from_dict(data, source)
