"""One row of a table of parameters, and how it checks a value."""

import math
from dataclasses import dataclass
from typing import Any

from rover_planner.errors import PlanningError

_TYPE_NAMES: dict[type, str] = {
    str: "string",
    float: "double",
    int: "integer",
    bool: "bool",
    list: "string array",
}


class ParameterError(PlanningError):
    """A parameter with a value that cannot be; the text names it and what would be right."""


@dataclass(frozen=True)
class ParameterSpec:
    """One row of a table of parameters; the default's type is the parameter's type."""

    name: str
    """Name as it is declared."""
    default: Any
    """Value unless told."""
    doc: str
    """One sentence for `ros2 param describe` and the docs."""
    unit: str = ""
    """Unit, empty where there is none."""
    bounds: tuple[float, float] | None = None
    """Smallest and largest allowed number."""
    choices: tuple[str, ...] = ()
    """Allowed texts; empty for any."""
    read_only: bool = False
    """Whether the value is fixed once the node runs."""

    @property
    def type_name(self) -> str:
        """Name of the type as ROS calls it."""
        return _TYPE_NAMES[type(self.default)]

    def check(self, value: Any) -> None:
        """Refuse a value of the wrong type, NaN, empty, out of bounds or not among the choices.

        Raises:
            ParameterError: names the parameter, the value and what would be right.
        """
        if type(value) is not type(self.default):
            raise ParameterError(
                f"parameter {self.name} is {value!r}; it must be of "
                f"type {self.type_name}, such as {self.default!r}"
            )
        if isinstance(value, list) and not all(isinstance(text, str) and text for text in value):
            raise ParameterError(
                f"parameter {self.name} is {value!r}; it must hold texts, none of them empty"
            )
        if value == "" != self.default:
            raise ParameterError(
                f"parameter {self.name} is empty; it must be a text such as {self.default!r}"
            )
        if isinstance(value, float) and not math.isfinite(value):
            raise ParameterError(f"parameter {self.name} is {value}; it must be a finite number")
        if self.bounds is not None and not self.bounds[0] <= value <= self.bounds[1]:
            raise ParameterError(
                f"parameter {self.name} is {value}; it must be in "
                f"{self.bounds[0]:g} to {self.bounds[1]:g} {self.unit}".rstrip()
            )
        if self.choices and value not in self.choices:
            raise ParameterError(
                f"parameter {self.name} is {value!r}; it must be one of {', '.join(self.choices)}"
            )
