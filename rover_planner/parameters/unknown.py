# SPDX-License-Identifier: Apache-2.0
"""Warns of parameters that are set at a node's start but do not exist."""

import difflib

from rclpy.node import Node

from rover_planner.parameters.table import ParameterTable, specs_of

_ROS_OWN = ("qos_overrides.",)


def warn_of_unknown_parameters(node: Node, table: type[ParameterTable]) -> None:
    """Log a warning for each parameter that was set at start and is not declared.

    Args:
        node: The node; all its parameters are declared.
        table: Its table of parameters.
    """
    names = [spec.name for spec in specs_of(table)]
    given = node._parameter_overrides  # rclpy has no public access to them
    for name in sorted(given):
        if not node.has_parameter(name) and not name.startswith(_ROS_OWN):
            node.get_logger().warning(_describe(name, names))


def _describe(name: str, names: list[str]) -> str:
    """Return a warning that a parameter does not exist, with the nearest existing name."""
    nearest = difflib.get_close_matches(name, names, n=1)
    hint = f"the nearest is {nearest[0]}" if nearest else "--help lists those there are"
    return f"parameter {name} does not exist and is ignored; {hint}"
