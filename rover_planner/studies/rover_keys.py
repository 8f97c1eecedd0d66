# SPDX-License-Identifier: Apache-2.0
"""Access to numbers of a rover file by dotted names, such as suspension.wheels.front.x."""

import difflib
from collections.abc import Iterator, Mapping
from typing import Any

from rover_physics.errors import RoverFileError
from rover_physics.files.validation import Key, describe, find_unit
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_from_dict, rover_to_dict

AXES = ("x", "y", "z")
"""Names of the three numbers of a point."""


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
    return known[name], find_unit(Rover, known[name])


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
    """Return a copy of a rover with changed numbers, by key.

    Raises:
        RoverFileError: The changed rover is invalid; the text names the key.
    """
    data = rover_to_dict(rover)
    for key, value in values.items():
        inner: Any = data
        for part in key[:-1]:
            inner = inner[part]
        inner[key[-1]] = float(value)
    return rover_from_dict(data, rover.name)
