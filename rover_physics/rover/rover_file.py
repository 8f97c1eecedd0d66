# SPDX-License-Identifier: Apache-2.0
"""Rover files: presets, and YAML files with the same keys."""

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import yaml

from rover_physics.files.config_files import find_config, find_file
from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of, read_as, refuse
from rover_physics.files.yaml_file import read_yaml
from rover_physics.limits import table
from rover_physics.rover.checks import check_rover
from rover_physics.rover.model import Rover


def preset_names() -> tuple[str, ...]:
    """Return the names of the rovers that come with the package, sorted."""
    return tuple(sorted(path.stem for path in find_config("rovers").glob("*.yaml")))


def load_rover(name_or_path: str | Path) -> Rover:
    """Load a rover by the name of a preset or from a file.

    Args:
        name_or_path: A preset's name such as ``"lsr1"``, or the path of a YAML file.

    Raises:
        RoverFileError: Neither a preset nor a file, or an invalid file; the text names the key.
    """
    presets = {name: find_config(f"rovers/{name}.yaml") for name in preset_names()}
    path = find_file("rover", name_or_path, presets)
    return rover_from_dict(read_yaml(path), str(path))


def rover_from_dict(data: object, source: str) -> Rover:
    """Build a rover from the contents of a rover file.

    Args:
        data: Nested mapping with the keys of a rover file, which are the fields of `Rover`; SI
            units, positions of the left side in the body frame.
        source: File name or other origin, at the start of every error text.

    Raises:
        RoverFileError: A key is missing, unknown or invalid; the text names the dotted key.
    """
    with errors_of(source):
        data, further = _take_further_limits(data)
        rover: Rover = read_as(Rover, data, "a rover file")
        if further:
            rover = replace(rover, limits=replace(rover.limits, further=further))
        check_rover(rover)
    return rover


def _take_further_limits(data: object) -> tuple[object, dict[str, float]]:
    """Return the contents without the optional limits of the table, and these."""
    limits = data.get("limits") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(limits, dict):
        return data, {}
    keys = [row.key for row in table.LIMITS if row.key and row.key in limits]
    for key in keys:
        if type(limits[key]) not in (int, float) or not math.isfinite(limits[key]):
            raise refuse(f"limits.{key}", limits[key], "a finite number")
    rest = {key: value for key, value in limits.items() if key not in keys}
    return {**data, "limits": rest}, {key: float(limits[key]) for key in keys}


def rover_to_dict(rover: Rover) -> dict[str, Any]:
    """Return the keys of a rover's file with their values; absent parts are left out."""
    contents: dict[str, Any] = _plain(asdict(rover))
    contents["limits"] |= contents["limits"].pop("further")
    return contents


def save_rover(path: Path, rover: Rover, comment: str = "") -> None:
    """Save a rover file; numbers are written in full, so it loads as the same rover.

    Args:
        path: The file; an existing one is overwritten.
        rover: The rover.
        comment: Lines at the top of the file, without ``#``.

    Raises:
        RoverFileError: It cannot be written.
    """
    save_yaml(path, rover_to_dict(rover), comment)


def save_yaml(path: Path, contents: dict[str, Any], comment: str = "") -> None:
    """Write contents as YAML, in their order; arguments and errors as for `save_rover`."""
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    text = yaml.safe_dump(contents, sort_keys=False, default_flow_style=None, width=99)
    with errors_of(path):
        write_file(path, (head + text).encode())


def _plain(value: Any) -> Any:
    """Return tuples as lists and drop keys without a value, at any depth."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    return [_plain(item) for item in value] if isinstance(value, tuple | list) else value
