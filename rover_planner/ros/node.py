# SPDX-License-Identifier: Apache-2.0
"""The node that each node program is: its parameters, what it hears, and what keeps it alive."""

import difflib
from array import array
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer

from msg_adapters.stamps import NANOSECONDS
from rover_physics.errors import RoverError
from rover_planner.parameters.table import ParameterError, ParameterSpec, ParameterTable, specs_of
from rover_planner.ros.guard import Guard, Handover
from rover_planner.ros.polled_topics import PolledTopics
from rover_planner.shell.run_program import one_line

ROS_OWN = ("qos_overrides.",)
"""Begins of names of parameters that ROS declares by itself."""

Table = TypeVar("Table", bound=ParameterTable)


class RoverNode(Node, Generic[Table]):
    """A node with the parameters of a table."""

    def __init__(self, name: str, table: type[Table], **node_arguments: Any):
        """Declare the parameters; the rest is for `rclpy.node.Node`.

        Raises:
            ParameterError: An override is not allowed by the table.
        """
        super().__init__(name, **node_arguments)
        self.values = declare_parameters(self, table)
        """The parameters in force."""
        self.guard = Guard(self.get_logger())
        """Takes unexpected errors."""
        self.handover = Handover(self, self.guard)
        """Calls functions of other threads in the executor's."""
        self.heard = PolledTopics(self, self.guard)
        """Topics that are read when the node needs what they say."""
        self.loop: Timer | None = None
        """Timer of what the node does all the time, for its executor; steady, or by ROS time."""
        self.urgent_threads: tuple[int, ...] = ()
        """Ids of the threads that take the real-time priority; empty for all of the process."""

    @property
    def seconds(self) -> float:
        """The present ROS time [s]."""
        return float(self.get_clock().now().nanoseconds / NANOSECONDS)

    def follow_changes(self, load: Callable[[Table], Any], apply: Callable[[Any], object]) -> None:
        """Refuse bad changes of the parameters with a reason, and apply the others.

        Parameters that are not in the table, such as use_sim_time, are accepted without a check.

        Args:
            load: Returns what the node makes of values; called before a change; raises if they
                cannot be combined.
            apply: Takes that after the change, when `values` has it.
        """
        accepted: tuple[Table, Any] | None = None

        def check(parameters: list[Parameter]) -> SetParametersResult:
            nonlocal accepted
            accepted = None
            try:
                if any(not parameter.name for parameter in parameters):
                    names = ", ".join(spec.name for spec in specs_of(type(self.values)))
                    raise ParameterError(f"a parameter has no name; it must be one of {names}")
                changes = values_in(type(self.values), parameters)
                if changes:
                    values = replace(self.values, **changes)
                    accepted = values, load(values)
            except RoverError as error:
                return SetParametersResult(successful=False, reason=one_line(str(error)))
            except Exception as error:
                reason = f"internal error: {self.guard.report('set_parameters', error)}"
                return SetParametersResult(successful=False, reason=one_line(reason))
            return SetParametersResult(successful=True)

        def pass_on(_parameters: list[Parameter]) -> None:
            if accepted is not None:
                self.values, made = accepted
                self.guard.call(partial(apply, made))

        self.add_on_set_parameters_callback(check)
        self.add_post_set_parameters_callback(pass_on)


def declare_parameters(node: Node, table: type[Table]) -> Table:
    """Declare the parameters of a table with their descriptors; return a table of their values.

    Parameters that were set and do not exist get a warning in the log.

    Raises:
        ParameterError: An override is not allowed by the table, which says so in its own words.
    """
    specs, given = specs_of(table), node._parameter_overrides  # rclpy has no public access
    # ROS takes [] for an override without a value.
    values = values_in(table, given.values())
    empty = [name for name in values if given[name].type_ == Parameter.Type.NOT_SET]
    table(**values | dict.fromkeys(empty, ()))
    for spec in specs:
        if spec.name in empty:
            raise ParameterError(
                f"parameter {spec.name} is [], which has no type in ROS; leave it out, its "
                f"default is {spec.ros_default}"
            )
    rows = [(spec.name, spec.ros_default, _descriptor(spec)) for spec in specs]
    found = node.declare_parameters("", rows)
    for name in sorted(given):
        if not node.has_parameter(name) and not name.startswith(ROS_OWN):
            nearest = difflib.get_close_matches(name, [spec.name for spec in specs], n=1)
            hint = f"the nearest is {nearest[0]}" if nearest else "--help lists those there are"
            node.get_logger().warning(f"parameter {name} does not exist and is ignored; {hint}")
    return table(**values_in(table, found))


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


def create_steady_timer(
    node: Node, period: float, do: Callable[[], object], *, starts: bool = True
) -> Timer:
    """Return a timer that calls a function each period [s], from now on or once it is reset.

    Neither a step of the system clock nor a stopped /clock delays it.
    """
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    return node.create_timer(period, do, clock=steady, autostart=starts)
