# SPDX-License-Identifier: Apache-2.0
"""Declares a node's parameters from their table, checks changes and passes them to the node."""

import difflib
import traceback
from array import array
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from rover_physics.errors import RoverError
from rover_planner.parameters.table import ParameterError, ParameterSpec, ParameterTable, specs_of
from rover_planner.shell.run_program import one_line

ROS_OWN = ("qos_overrides.",)
"""Begins of names of parameters that ROS declares by itself."""

Table = TypeVar("Table", bound=ParameterTable)


def declare_parameters(node: Node, table: type[Table]) -> Table:
    """Declare the parameters of a table with their descriptors; return a table of their values.

    Raises:
        ParameterError: An override is not allowed by the table.
    """
    found = []
    for spec in specs_of(table):
        _refuse_empty_list(node, table, spec)
        try:
            node.declare_parameter(spec.name, spec.ros_default, _descriptor(spec))
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            _explain_override(node, table, spec)
            raise ParameterError(f"parameter {spec.name}: {error}") from error
        found.append(node.get_parameter(spec.name))
    return replace(table(), **_changes(table, found))


def follow_changes(
    node: Node,
    current: Callable[[], Table],
    accept: Callable[[Table], object],
    apply: Callable[[Table], None],
) -> None:
    """Check changes of a node's parameters: refuse bad ones with a reason, apply the others.

    Args:
        node: A node that has declared the table.
        current: Returns the current values.
        accept: Called with all values before a change; raises if the combination is invalid.
        apply: Called with all values after a change.

    Parameters that are not in the table, such as use_sim_time, are accepted without a check and
    call neither function.
    """

    def check(parameters: list[Parameter]) -> SetParametersResult:
        values = current()
        try:
            if any(not parameter.name for parameter in parameters):
                names = ", ".join(spec.name for spec in specs_of(type(values)))
                raise ParameterError(f"a parameter has no name; it must be one of {names}")
            changes = _changes(type(values), parameters)
            if changes:
                accept(replace(values, **changes))
        except RoverError as error:
            return SetParametersResult(successful=False, reason=one_line(str(error)))
        except Exception as error:
            # An internal error must not end the node.
            node.get_logger().error(f"set_parameters: {traceback.format_exc()}")
            reason = f"internal error: {type(error).__name__}: {error}"
            return SetParametersResult(successful=False, reason=one_line(reason))
        return SetParametersResult(successful=True)

    def pass_on(parameters: list[Parameter]) -> None:
        changes = _changes(type(current()), parameters)
        if not changes:
            return
        try:
            apply(replace(current(), **changes))
        except Exception:
            # A file that was good in the check may be gone by now; the node goes on as before.
            node.get_logger().error(f"parameters not applied: {traceback.format_exc()}")

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(pass_on)


def warn_of_unknown_parameters(node: Node, table: type[ParameterTable]) -> None:
    """Log a warning for each parameter that was set at start and is not declared.

    Args:
        node: The node; all its parameters are declared.
        table: Its table of parameters.
    """
    names = [spec.name for spec in specs_of(table)]
    given = node._parameter_overrides  # rclpy has no public access to them
    for name in sorted(given):
        if not node.has_parameter(name) and not name.startswith(ROS_OWN):
            node.get_logger().warning(_describe_unknown(name, names))


def _describe_unknown(name: str, names: list[str]) -> str:
    """Return a warning that a parameter does not exist, with the nearest existing name."""
    nearest = difflib.get_close_matches(name, names, n=1)
    hint = f"the nearest is {nearest[0]}" if nearest else "--help lists those there are"
    return f"parameter {name} does not exist and is ignored; {hint}"


def _refuse_empty_list(node: Node, table: type[ParameterTable], spec: ParameterSpec) -> None:
    """Raise ParameterError if an override is [], which ROS takes for one without a value."""
    given = node._parameter_overrides.get(spec.name)
    if given is None or given.type_ != Parameter.Type.NOT_SET:
        return
    replace(table(), **{spec.name: ()})
    raise ParameterError(
        f"parameter {spec.name} is [], which has no type in ROS; leave it out, its default is "
        f"{spec.ros_default}"
    )


def _explain_override(node: Node, table: type[ParameterTable], spec: ParameterSpec) -> None:
    """Raise ParameterError in the words of the table if an override breaks its rules."""
    given = node._parameter_overrides.get(spec.name)
    if given is not None:
        replace(table(), **_changes(table, [given]))


def _changes(table: type[ParameterTable], parameters: Iterable[Parameter]) -> dict[str, Any]:
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
