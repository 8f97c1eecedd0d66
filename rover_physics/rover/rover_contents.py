# SPDX-License-Identifier: Apache-2.0
"""The contents of a rover file for a rover, and its text."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of
from rover_physics.rover.model import Rover


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
