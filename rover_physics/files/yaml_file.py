# SPDX-License-Identifier: Apache-2.0
"""Strict reading of YAML files: duplicate keys, large files and nested references are errors."""

from pathlib import Path
from typing import Any

import yaml

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import read_regular_file
from rover_physics.files.validation import errors_of, show_key

MAX_BYTES = 100_000
"""Largest file; PyYAML takes 0.8 s for it."""
MAX_NODES = 100_000
"""Largest number of keys and values, each reference counted as what it refers to."""
MAX_REASON = 200
"""Largest number of characters of PyYAML's reason in an error text."""
UNNAMED = '"<unicode string>", '
"""PyYAML's name of the text, left out: who reads a file puts its name before the error."""
BAD_SCALAR = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""Exceptions that PyYAML raises, besides its own, for a value that does not fit its tag."""


class _StrictLoader(yaml.SafeLoader):
    """A safe loader that refuses duplicate keys in a mapping.

    PyYAML's own in C is ten times as fast, but ends the process on deeply nested text.
    """

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
        RoverFileError: Not a regular file, unreadable or larger than MAX_BYTES; or as for
            `parse_yaml`.
    """
    with errors_of(path):
        try:
            text = read_regular_file(path, MAX_BYTES).decode("utf-8")
        except UnicodeDecodeError as error:
            raise RoverFileError(f"not a text file in UTF-8 ({error.reason})") from error
        return parse_yaml(text)


def parse_yaml(text: str) -> object:
    """Return the contents of a YAML text as dicts, lists and scalars; None for an empty text.

    Raises:
        RoverFileError: Invalid YAML, a duplicate key, or references with more than MAX_NODES
            nodes.
    """
    try:
        return _construct(_StrictLoader(text))
    except (yaml.YAMLError, RecursionError, *BAD_SCALAR) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        reason = reason.replace(UNNAMED, "")
        raise RoverFileError(f"not valid YAML: {reason[:MAX_REASON]}") from error


def _construct(loader: _StrictLoader) -> object:
    node = loader.get_single_node()
    if node is None:
        return None
    count = _count_nodes(node, {})
    if count > MAX_NODES:
        raise RoverFileError(
            f"not valid YAML: its references stand for {count:.1g} values; at most {MAX_NODES} "
            "are read"
        )
    return loader.construct_document(node)


def _count_nodes(node: yaml.Node, counted: dict[int, float]) -> float:
    """Return the number of nodes of a tree, a node that is referred to counted each time."""
    if id(node) not in counted:
        counted[id(node)] = float("inf")  # a node that contains itself
        children = node.value if isinstance(node, yaml.CollectionNode) else ()
        if isinstance(node, yaml.MappingNode):
            children = [child for pair in children for child in pair]
        counted[id(node)] = 1.0 + sum(_count_nodes(child, counted) for child in children)
    return counted[id(node)]
