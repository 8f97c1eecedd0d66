"""Numbers of a rover file by dotted names, such as suspension.wheels.front.x."""

import difflib
from collections.abc import Iterator, Mapping
from typing import Any

from rover_physics.errors import RoverFileError
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict
from rover_planner.studies.rover_values import rover_to_dict

Key = tuple[str | int, ...]
AXES = ("x", "y", "z")
UNITS = {
    "mass": "kg", "max_torque": "N m", "max_speed": "rad/s", "gravity": "m/s^2", "friction": "",
    "nominal_speed": "m/s", "payload": "kg", "link_masses": "kg", "stowed": "rad", "tilt": "rad",
    "joint_limits": "rad", "rocker_limits": "rad", "bogie_limits": "rad", "tip_over_ratio": "",
    "friction_utilisation": "", "torque_saturation": "",
}  # fmt: skip
"""Units of what is no length, by the last name of a key."""


def find_key(contents: Mapping[str, Any], name: str, source: str) -> tuple[Key, str]:
    """Return where a number of a rover file is, and its unit.

    Args:
        contents: Contents of the rover file.
        name: Dotted name; the numbers of a point are x, y, z, others count from 0.
        source: Opens the error text.

    Raises:
        RoverFileError: There is no such number; names the nearest.
    """
    known = dict(_list_keys(contents))
    if name not in known:
        near = difflib.get_close_matches(name, known, 3) or sorted(known)[:3]
        raise RoverFileError(
            f"{source}: the rover has no number {name!r}; it has {', '.join(near)}, ..."
        )
    key = known[name]
    words = [str(part) for part in key if isinstance(part, str)]
    return key, UNITS.get(words[-1], "m")


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


def vary(rover: Rover, values: Mapping[Key, float]) -> Rover:
    """Return a rover with other numbers, by their keys.

    Raises:
        RoverFileError: No such rover can be; names the key.
    """
    data = rover_to_dict(rover)
    for key, value in values.items():
        inner: Any = data
        for part in key[:-1]:
            inner = inner[part]
        inner[key[-1]] = float(value)
    return rover_from_dict(data, rover.name)
