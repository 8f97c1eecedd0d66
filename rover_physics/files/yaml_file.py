"""Reads a YAML file strictly: duplicate keys and unreadable files are errors."""

from pathlib import Path
from typing import Any

import yaml

from rover_physics.errors import RoverFileError


class _StrictLoader(yaml.SafeLoader):
    """A safe loader that refuses a key which stands twice in one mapping."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: dict[str, int] = {}
        for key_node, _ in node.value:
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if key in seen and key_node.tag != "tag:yaml.org,2002:merge":
                raise RoverFileError(
                    f"duplicate key {key} in lines {seen[key]} and {line}; keep one of them"
                )
            seen[key] = line
        return super().construct_mapping(node, deep=deep)


def read_yaml(path: Path) -> object:
    """Read a YAML file.

    Args:
        path: The file.

    Returns:
        What the file holds, made of dicts, lists and scalars; None for an empty file.

    Raises:
        RoverFileError: Unreadable file, broken YAML, or a key that stands twice.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise RoverFileError(f"{path}: not a text file in UTF-8 ({error.reason})") from error
    except OSError as error:
        reason = error.strerror or error
        raise RoverFileError(f"{path}: cannot be read: {reason}") from error
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except RoverFileError as error:
        raise RoverFileError(f"{path}: {error}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise RoverFileError(f"{path}: not valid YAML: {_one_line(error)}") from error


def _one_line(error: Exception) -> str:
    """Put the text of an error into one line."""
    return " ".join(str(error).split()) or type(error).__name__
