# SPDX-License-Identifier: Apache-2.0
"""Values of a rover that can be changed interactively: labels, units and ranges."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from rover_physics.files.validation import Key, errors_of
from rover_physics.files.yaml_file import parse_yaml
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict


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

    def length(label: str, *key: str | int, reach: float) -> RoverValue:
        now = get_value(data, key)
        return _make_value((key,), f"{label} [m]", now, now - reach, now + reach)

    def amount(label: str, unit: str, *key: str | int, top: float = 0.0) -> RoverValue:
        now = get_value(data, key)
        return _make_value((key,), f"{label} [{unit}]", now, 0.2 * now, max(2.5 * now, top))

    names = ("rear", "middle", "front")
    height = length("wheels z", "suspension", "wheels", "rear", 2, reach=1.5 * radius)
    all_wheels = tuple(("suspension", "wheels", name, 2) for name in names)
    wheels = [
        length(f"{name} wheel x", "suspension", "wheels", name, 0, reach=span) for name in names
    ]
    values = {
        "Ground and drive": [
            amount("friction", "-", "friction"),
            amount("torque limit", "N m", "wheel", "max_torque"),
            amount("speed", "m/s", "nominal_speed"),
            amount("gravity", "m/s^2", "gravity"),
        ],
        "Links": [
            length("bogie pivot x", "suspension", "bogie_pivot", 0, reach=span),
            length("bogie pivot z", "suspension", "bogie_pivot", 2, reach=1.5 * radius),
            *wheels,
            dataclasses.replace(height, keys=all_wheels),
        ],
        "Wheels": [
            amount("radius", "m", "wheel", "radius"),
            amount("width", "m", "wheel", "width"),
        ],
        "Masses": [
            amount("body", "kg", "masses", "body", "mass"),
            length("body centre x", "masses", "body", "com", 0, reach=span),
            length("body centre z", "masses", "body", "com", 2, reach=2.0 * radius),
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


def get_value(data: Mapping[str, Any], key: Key) -> float:
    """Return a number from the contents of a rover file, by key."""
    inner: Any = data
    for part in key:
        inner = inner[part]
    return float(inner)


def with_value(rover: Rover, keys: Sequence[Key], value: float) -> Rover:
    """Return a copy of a rover with the same value at all of the keys.

    Raises:
        RoverFileError: The changed rover is invalid; the text names the key.
    """
    data = rover_to_dict(rover)
    for key in keys:
        inner: Any = data
        for part in key[:-1]:
            inner = inner[part]
        inner[key[-1]] = float(value)
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
