"""The values of a rover that can be changed while it is watched: names, units and ranges."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rover_physics.rover import Rover, rover_from_dict
from rover_planner.errors import PlanningError

Key = tuple[str | int, ...]


@dataclass(frozen=True)
class RoverValue:
    """One number of a rover file."""

    keys: tuple[Key, ...]
    """Where it is in the file, such as ("wheel", "radius"); several that are always alike."""
    label: str
    """What it is called, with its unit."""
    low: float
    """Smallest value offered; the rover file's own checks decide what is possible."""
    high: float
    """Largest value offered."""
    step: float
    """Smallest change."""


def rover_to_dict(rover: Rover) -> dict[str, Any]:
    """Return the contents of a rover file, as `rover_from_dict` reads them."""
    data = _plain(dataclasses.asdict(rover))
    arm = data["manipulator"]
    if arm is None:
        del data["manipulator"]
    elif arm["joint_limits"] is None:
        del arm["joint_limits"]
    return data


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, tuple | list) else value


def list_values(rover: Rover) -> dict[str, list[RoverValue]]:
    """List what can be changed of a rover, by the part that it belongs to."""
    data, length = rover_to_dict(rover), rover.suspension.wheels["front"][0]
    radius = rover.wheel.radius

    def value(label: str, unit: str, *key: str | int, span: float | None = None) -> RoverValue:
        now = float(get_value(data, key))
        if span is None:
            low, high = 0.25 * now, 2.5 * now
        else:
            low, high = now - span, now + span
        step = 10.0 ** (len(str(int((high - low) * 1000))) - 6)
        return RoverValue((key,), f"{label} [{unit}]", _tidy(low, step), _tidy(high, step), step)

    names = ("rear", "middle", "front")
    height = value("wheel height", "m", "suspension", "wheels", "rear", 2, span=1.5 * radius)
    all_wheels = tuple(("suspension", "wheels", name, 2) for name in names)
    wheels = [
        value(f"{name} wheel x", "m", "suspension", "wheels", name, 0, span=abs(length))
        for name in names
    ]
    return {
        "Links": [
            value("bogie pivot x", "m", "suspension", "bogie_pivot", 0, span=0.5 * abs(length)),
            value("bogie pivot z", "m", "suspension", "bogie_pivot", 2, span=1.5 * radius),
            *wheels,
            dataclasses.replace(height, keys=all_wheels),
        ],
        "Wheels": [
            value("radius", "m", "wheel", "radius"),
            value("width", "m", "wheel", "width"),
            value("torque limit", "N m", "wheel", "max_torque"),
            value("mass", "kg", "wheel", "mass"),
        ],
        "Masses": [
            value("body", "kg", "masses", "body", "mass"),
            value("body centre x", "m", "masses", "body", "com", 0, span=0.5 * abs(length)),
            value("body centre z", "m", "masses", "body", "com", 2, span=2.0 * radius),
            value("rocker", "kg", "masses", "rocker", "mass"),
            value("bogie", "kg", "masses", "bogie", "mass"),
        ],
        "Drive": [
            value("friction", "-", "friction"),
            value("speed", "m/s", "nominal_speed"),
            value("gravity", "m/s^2", "gravity"),
        ],
    }


def _tidy(value: float, step: float) -> float:
    return round(round(value / step) * step, 9)


def get_value(data: Mapping[str, Any], key: Key) -> float:
    """Return a number of the contents of a rover file."""
    inner: Any = data
    for part in key:
        inner = inner[part]
    return float(inner)


def with_value(rover: Rover, keys: Sequence[Key], value: float) -> Rover:
    """Return a rover with one number changed, wherever the keys say that it is.

    Raises:
        RoverFileError: The rover would be impossible; names the key.
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
        PlanningError: The text is no YAML.
        RoverFileError: The rover is impossible; names the key.
    """
    try:
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise PlanningError(f"{source} is no YAML: {' '.join(str(error).split())}") from None
    return rover_from_dict(data, source)


def save_rover(rover: Rover, path: Path) -> None:
    """Write a rover file.

    Raises:
        PlanningError: The file cannot be written.
    """
    try:
        path.write_text(write_rover(rover), encoding="utf-8")
    except OSError as error:
        raise PlanningError(f"cannot write {path}: {error.strerror}") from None
