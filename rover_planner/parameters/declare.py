"""Declares a table of parameters with a node, and checks what others set."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from msg_adapters.errors import MessageError
from rover_physics.errors import RoverError
from rover_planner.errors import PlanningError
from rover_planner.parameters.spec import ParameterError, ParameterSpec


def declare_parameters(node: Node, specs: Iterable[ParameterSpec]) -> dict[str, Any]:
    """Declare parameters with their descriptors and return their checked values by name.

    Raises:
        ParameterError: an override that `ParameterSpec.check` refuses.
    """
    values = {}
    for spec in specs:
        try:
            node.declare_parameter(spec.name, spec.default, _descriptor(spec))
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise ParameterError(f"parameter {spec.name}: {error}") from error
        values[spec.name] = node.get_parameter(spec.name).value
        spec.check(values[spec.name])
    return values


def check_changes(
    specs: Iterable[ParameterSpec],
    values: Mapping[str, Any],
    accept: Callable[[dict[str, Any]], Any],
) -> Callable[[list[Parameter]], SetParametersResult]:
    """Make an on-set callback that refuses bad values with the reason in the result.

    Args:
        specs: The node's table; other parameters, such as use_sim_time, pass unchecked.
        values: The values in force, looked at when the callback is called.
        accept: Called with all values as they would be; raises where they do not go together.
    """
    by_name = {spec.name: spec for spec in specs}

    def check(parameters: list[Parameter]) -> SetParametersResult:
        changes = {
            parameter.name: parameter.value
            for parameter in parameters
            if parameter.name in by_name
        }
        try:
            if any(not parameter.name for parameter in parameters):
                raise ParameterError("a parameter has no name; name one of " + ", ".join(by_name))
            for name, value in changes.items():
                by_name[name].check(value)
            if changes:
                accept({**values, **changes})
        except (MessageError, PlanningError, RoverError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    return check


def _descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """Return the descriptor that tools show."""
    unit = f" [{spec.unit}]" if spec.unit else ""
    descriptor = ParameterDescriptor(
        name=spec.name, description=spec.doc + unit, read_only=spec.read_only
    )
    if spec.choices:
        descriptor.additional_constraints = "one of " + ", ".join(spec.choices)
    if spec.bounds is not None and isinstance(spec.default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=spec.bounds[0], to_value=spec.bounds[1])
        ]
    elif spec.bounds is not None:
        descriptor.integer_range = [
            IntegerRange(from_value=int(spec.bounds[0]), to_value=int(spec.bounds[1]))
        ]
    return descriptor
