# SPDX-License-Identifier: Apache-2.0
"""Declares a node's parameters from their table."""

import difflib
from array import array
from collections.abc import Iterable
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from rover_planner.parameters.table import ParameterError, ParameterSpec, ParameterTable, specs_of

ROS_OWN = ("qos_overrides.",)
"""Begins of names of parameters that ROS declares by itself."""

Table = TypeVar("Table", bound=ParameterTable)


def declare_parameters(node: Node, table: type[Table]) -> Table:
    """Declare the parameters of a table with their descriptors; return a table of their values.

    Parameters that were set and do not exist get a warning in the log.

    Raises:
        ParameterError: An override is not allowed by the table.
    """
    specs = specs_of(table)
    for spec in specs:
        _check_override(node, table, spec)
    rows = [(spec.name, spec.ros_default, _descriptor(spec)) for spec in specs]
    found = node.declare_parameters("", rows)
    _warn_of_unknown_parameters(node, [spec.name for spec in specs])
    return table(**values_in(table, found))


def _warn_of_unknown_parameters(node: Node, names: list[str]) -> None:
    """Log a warning for each parameter that was set at start and is not declared."""
    given = node._parameter_overrides  # rclpy has no public access to them
    for name in sorted(given):
        if not node.has_parameter(name) and not name.startswith(ROS_OWN):
            nearest = difflib.get_close_matches(name, names, n=1)
            hint = f"the nearest is {nearest[0]}" if nearest else "--help lists those there are"
            node.get_logger().warning(f"parameter {name} does not exist and is ignored; {hint}")


def _check_override(node: Node, table: type[ParameterTable], spec: ParameterSpec) -> None:
    """Raise ParameterError, in the words of the table, if an override breaks its rules.

    ROS takes [] for an override without a value.
    """
    given = node._parameter_overrides.get(spec.name)
    if given is None:
        return
    is_empty = given.type_ == Parameter.Type.NOT_SET
    table(**({spec.name: ()} if is_empty else values_in(table, [given])))
    if is_empty:
        raise ParameterError(
            f"parameter {spec.name} is [], which has no type in ROS; leave it out, its default is "
            f"{spec.ros_default}"
        )


def values_in(table: type[ParameterTable], parameters: Iterable[Parameter]) -> dict[str, Any]:
    """Return the values of the parameters in a table by name; lists become tuples."""
    names = {spec.name for spec in specs_of(table)}
    return {
        parameter.name: (
            tuple(parameter.value)
            if isinstance(parameter.value, list | array)
            else parameter.value
        )
        for parameter in parameters
        if parameter.name in names
    }


def _descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """Return the descriptor that ROS tools show."""
    unit = f" [{spec.unit}]" if spec.unit else ""
    descriptor = ParameterDescriptor(
        name=spec.name, description=spec.meaning + unit, read_only=spec.read_only
    )
    if spec.choices:
        descriptor.additional_constraints = "one of " + ", ".join(spec.choices)
    if spec.bounds is not None and not isinstance(spec.default, int):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=spec.bounds[0], to_value=spec.bounds[1])
        ]
    elif spec.bounds is not None:
        descriptor.integer_range = [
            IntegerRange(from_value=int(spec.bounds[0]), to_value=int(spec.bounds[1]))
        ]
    return descriptor
