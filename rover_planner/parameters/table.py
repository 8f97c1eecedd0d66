# SPDX-License-Identifier: Apache-2.0
"""Base of the tables of node parameters: dataclasses whose fields have meaning, unit, bounds."""

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, TypeVar

from rover_planner.errors import PlanningError

Value = TypeVar("Value")

_ROS_TYPES: dict[type, str] = {str: "string", float: "double", int: "integer", bool: "bool"}


class ParameterError(PlanningError):
    """A parameter value that is not allowed; the text says which values are allowed."""


@dataclass(frozen=True)
class ParameterSpec:
    """One row of a table: meaning, default and allowed values of a parameter."""

    name: str
    """Name of the parameter, and of the field."""
    default: Any
    """Default value; an array has items."""
    meaning: str
    """Meaning, in one sentence, for `ros2 param describe` and the documentation."""
    unit: str
    """Unit, empty if there is none."""
    bounds: tuple[float, float] | None
    """Smallest and largest allowed number, in `unit`; None allows any."""
    choices: tuple[str, ...]
    """Allowed texts; empty allows any."""
    read_only: bool
    """True if the value is fixed after the start of the node."""
    least: float
    """Smallest allowed number other than 0."""

    @property
    def type_name(self) -> str:
        """ROS name of the type."""
        if isinstance(self.default, tuple):
            return f"{_ROS_TYPES[type(self.default[0])]} array"
        return _ROS_TYPES[type(self.default)]

    @property
    def ros_default(self) -> Any:
        """Default value for ROS: a tuple becomes a list."""
        return list(self.default) if isinstance(self.default, tuple) else self.default

    def check(self, value: Any) -> None:
        """Check a value.

        Raises:
            ParameterError: The value has a wrong type, is NaN, empty, out of bounds or not one
                of the choices.
        """
        must = self._find_broken_rule(value)
        if must:
            shown = repr(list(value) if isinstance(value, tuple) else value)
            is_empty = value == "" and isinstance(self.default, str)
            raise ParameterError(
                f"parameter {self.name} is {'empty' if is_empty else shown}; it must {must}"
            )

    def _find_broken_rule(self, value: Any) -> str:
        """Return what a value must be and is not; empty if it is allowed."""
        if type(value) is not type(self.default):
            return f"be of type {self.type_name}, such as {self.ros_default!r}"
        if isinstance(value, tuple):
            return self._find_broken_rule_of_items(value)
        if value == "" != self.default:
            return f"be a text such as {self.default!r}"
        if isinstance(value, float) and not math.isfinite(value):
            return "be a finite number"
        low, high = self.bounds or (-math.inf, math.inf)
        if self.bounds and not low <= value <= high:
            return f"be in {low:g} to {high:g} {self.unit}".rstrip()
        if self.least and 0.0 < value < self.least:
            return f"be 0, or at least {self.least:g} {self.unit}"
        if self.choices and value not in self.choices:
            return f"be one of {', '.join(self.choices)}"
        return ""

    def _find_broken_rule_of_items(self, values: tuple[Any, ...]) -> str:
        """Return the same for the items of an array; one of numbers keeps the default's length."""
        if self.type_name == "string array":
            are_texts = all(isinstance(text, str) and text for text in values)
            return "" if are_texts else "hold texts, none of them empty"
        low, high = self.bounds or (-math.inf, math.inf)
        right = len(values) == len(self.default) and all(
            isinstance(number, float) and math.isfinite(number) and low <= number <= high
            for number in values
        )
        allowed = f", in {low:g} to {high:g} {self.unit}".rstrip() if self.bounds else ""
        return "" if right else f"hold {len(self.default)} finite doubles such as 0.0{allowed}"


def parameter(
    default: Value,
    meaning: str,
    unit: str = "",
    bounds: tuple[float, float] | None = None,
    *,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
    least: float = 0.0,
) -> Value:
    """Make a field of a `ParameterTable`; `ParameterSpec` explains the arguments."""
    spec = ParameterSpec("", default, meaning, unit, bounds, choices, read_only, least)
    made: Any = field(default=default, metadata={"spec": spec})
    return made  # a dataclass field at run time; type checkers see the type of its value


@dataclass(frozen=True)
class ParameterTable:
    """Base class of a node's parameters; the constructor checks all values.

    Raises:
        ParameterError: `ParameterSpec.check` refuses a value.
    """

    all_read_only: ClassVar[bool] = False
    """True if no value changes after the start of the node."""

    def __post_init__(self) -> None:
        for spec in specs_of(type(self)):
            spec.check(getattr(self, spec.name))


def specs_of(table: type[ParameterTable]) -> tuple[ParameterSpec, ...]:
    """Return the rows of a table in the order of its fields."""
    specs = {row.name: row.metadata["spec"] for row in fields(table)}
    return tuple(
        replace(spec, name=name, read_only=table.all_read_only or spec.read_only)
        for name, spec in specs.items()
    )
