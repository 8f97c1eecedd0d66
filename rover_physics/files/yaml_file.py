"""Strict reading of YAML files: duplicate keys and unreadable files are errors."""

from pathlib import Path
from typing import Any

import yaml

from rover_physics.errors import RoverFileError
from rover_physics.files.validation import errors_of, show_key

MAX_REASON = 200
"""Largest number of characters of PyYAML's reason in an error text."""
BAD_SCALAR = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""Exceptions that PyYAML raises, besides its own, for a value that does not fit its tag."""


class _StrictLoader(yaml.SafeLoader):
    """A safe loader that refuses duplicate keys in a mapping."""

    def construct_mapping(self, node: yaml.Node, deep: bool = False) -> dict[Any, Any]:
        seen: dict[str, int] = {}
        for key_node, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise RoverFileError(f"not valid YAML: a key that is not a text in line {line}")
            key = key_node.value
            if key in seen and key_node.tag != "tag:yaml.org,2002:merge":
                raise RoverFileError(
                    f"duplicate key {show_key((key,))} in lines {seen[key]} and {line}; "
                    "keep one of them"
                )
            seen[key] = line
        return super().construct_mapping(node, deep=deep)

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Merge other mappings into one; of equal keys, the last one counts."""
        super().flatten_mapping(node)
        pairs: dict[object, object] = {}
        for pair in node.value:
            key = pair[0]
            pairs[(key.tag, key.value) if isinstance(key, yaml.ScalarNode) else id(key)] = pair
        node.value = list(pairs.values())


def read_yaml(path: Path) -> object:
    """Read a YAML file.

    Args:
        path: The file.

    Returns:
        The contents as dicts, lists and scalars; None for an empty file.

    Raises:
        RoverFileError: Unreadable file, invalid YAML, or a duplicate key.
    """
    with errors_of(path):
        return parse_yaml(_read_text(path))


def parse_yaml(text: str) -> object:
    """Return the contents of a YAML text as dicts, lists and scalars; None for an empty text.

    Raises:
        RoverFileError: Invalid YAML, or a duplicate key.
    """
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except (yaml.YAMLError, RecursionError, *BAD_SCALAR) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RoverFileError(f"not valid YAML: {reason[:MAX_REASON]}") from error


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise RoverFileError(f"not a text file in UTF-8 ({error.reason})") from error
    except OSError as error:
        raise RoverFileError(f"cannot be read: {error.strerror or error}") from error
