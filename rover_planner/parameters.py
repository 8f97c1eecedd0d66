"""Parameters of the nodes: one table each, from which declaration, checks and docs are made."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
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

from msg_adapters.elevation import CELL_HEIGHTS
from msg_adapters.errors import MessageError
from rover_physics.errors import RoverError
from rover_physics.names import WHEEL_JOINTS
from rover_physics.uncertainty import SIGMAS
from rover_planner.errors import PlanningError
from rover_planner.qos import MAP_DURABILITIES

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


TRAVERSE_SERVER = (
    ParameterSpec("rover", "lsr1", "Rover to ask about: a preset's name or a rover file."),
    ParameterSpec(
        "friction",
        0.0,
        "Coulomb friction where the map has none; 0 takes the rover file's.",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "max_torque",
        0.0,
        "Largest torque of a wheel; 0 takes the rover file's.",
        "N m",
        bounds=(0.0, 1e6),
    ),
    ParameterSpec(
        "soil",
        "",
        "Soil of config/soils.yaml where the map names none; empty is Coulomb friction.",
    ),
    ParameterSpec(
        "payload",
        -1.0,
        "Mass at the tip of the manipulator; -1 takes the rover file's.",
        "kg",
        bounds=(-1.0, 1e6),
    ),
    ParameterSpec(
        "policy",
        "equal",
        "How the wheels share the traction: equal torques, or optimal with traction control.",
        choices=("equal", "optimal"),
    ),
    ParameterSpec(
        "candidate_count",
        9,
        "Largest number of candidate paths between start and goal.",
        bounds=(1, 99),
    ),
    ParameterSpec(
        "candidate_spacing",
        0.3,
        "Distance between neighbouring candidates half-way.",
        "m",
        bounds=(0.01, 10.0),
    ),
    ParameterSpec(
        "waypoint_spacing",
        0.02,
        "Largest distance between judged waypoints.",
        "m",
        bounds=(0.001, 1.0),
    ),
    ParameterSpec(
        "plan_spacing",
        0.1,
        "Distance between poses of a plan, which has those where the grade changes too; "
        "0 returns every waypoint.",
        "m",
        bounds=(0.0, 100.0),
    ),
    ParameterSpec(
        "map_frame",
        "map",
        "Frame of the map; requests in another frame are refused.",
        read_only=True,
    ),
    ParameterSpec(
        "map_resolution",
        0.0,
        "Cell size for clouds; 0 takes their spacing where they are a regular grid.",
        "m",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "cell_height",
        "max",
        "Height of a cell with several points; max keeps obstacles, mean is unbiased.",
        choices=CELL_HEIGHTS,
    ),
    ParameterSpec(
        "map_durability",
        "either",
        "Publishers of the map that are heard, by their durability.",
        choices=MAP_DURABILITIES,
        read_only=True,
    ),
    ParameterSpec(
        "unknown_cells",
        "refuse",
        "What becomes of unknown cells: refuse paths over them, or interpolate small gaps.",
        choices=("refuse", "interpolate"),
    ),
    ParameterSpec(
        "max_gap", 0.2, "Widest unknown region that is interpolated.", "m", bounds=(0.0, 100.0)
    ),
    ParameterSpec(
        "map_sigmas",
        SIGMAS,
        "Standard deviations by which heights may be wrong where the map has elevation_std; "
        "0 takes them as exact.",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "terrain_file", "", "Terrain file to start with; empty waits for a map.", read_only=True
    ),
    ParameterSpec(
        "suspension_tolerance",
        0.1,
        "Difference of measured and predicted suspension angles that raises a warning.",
        "rad",
        bounds=(0.0, 3.2),
    ),
)
"""Parameters of `/traverse_server`."""

TRACTION_CONTROLLER = (
    ParameterSpec("rover", "lsr1", "Rover that is driven: a preset's name or a rover file."),
    ParameterSpec(
        "joints",
        list(WHEEL_JOINTS),
        "Wheel joints in the order of the values of ~/commands.",
        read_only=True,
    ),
    ParameterSpec(
        "rate", 50.0, "Updates per second.", "1/s", bounds=(10.0, 500.0), read_only=True
    ),
    ParameterSpec(
        "realtime_priority",
        0,
        "Precedence of this process over ordinary ones (SCHED_FIFO), where granted; 0 for none.",
        bounds=(0, 99),
        read_only=True,
    ),
    ParameterSpec(
        "timeout",
        0.08,
        "Age from which joint states, attitude and cmd_vel are stale; torques are then zero.",
        "s",
        bounds=(0.01, 1.0),
    ),
    ParameterSpec(
        "odometry_timeout",
        0.5,
        "Age from which odometry is not used.",
        "s",
        bounds=(0.01, 10.0),
    ),
    ParameterSpec(
        "friction",
        0.0,
        "Coulomb friction that is counted on; 0 takes the rover file's.",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "max_torque",
        0.0,
        "Largest torque of a wheel; 0 takes the rover file's.",
        "N m",
        bounds=(0.0, 1e6),
    ),
    ParameterSpec(
        "payload",
        -1.0,
        "Mass at the tip of the manipulator; -1 takes the rover file's.",
        "kg",
        bounds=(-1.0, 1e6),
    ),
    ParameterSpec(
        "policy",
        "optimal",
        "How the wheels share the traction: smallest peak friction utilisation, or equal torques.",
        choices=("equal", "optimal"),
    ),
    ParameterSpec("torque_rate", 20.0, "Largest change of a torque.", "N m/s", bounds=(0.1, 1e6)),
    ParameterSpec("speed_gain", 6.0, "Acceleration per error of speed.", "1/s", bounds=(0.0, 1e3)),
    ParameterSpec(
        "travel_gain", 12.0, "Acceleration per error of way.", "1/s^2", bounds=(0.0, 1e4)
    ),
    ParameterSpec(
        "heading_gain",
        2.0,
        "Angular acceleration per error of yaw rate.",
        "1/s",
        bounds=(0.0, 1e3),
    ),
    ParameterSpec(
        "slip_gain",
        1.0,
        "Torque against a wheel that leaves its rolling speed, in weights times radius squared.",
        "s/m",
        bounds=(0.0, 1e3),
    ),
    ParameterSpec(
        "map_frame",
        "map",
        "Frame of map and odometry; what comes in another frame is refused.",
        read_only=True,
    ),
    ParameterSpec(
        "map_resolution",
        0.0,
        "Cell size for clouds; 0 takes their spacing where they are a regular grid.",
        "m",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "cell_height",
        "max",
        "Height of a cell with several points; max keeps obstacles, mean is unbiased.",
        choices=CELL_HEIGHTS,
    ),
    ParameterSpec(
        "map_durability",
        "either",
        "Publishers of the map that are heard, by their durability.",
        choices=MAP_DURABILITIES,
        read_only=True,
    ),
)
"""Parameters of `/traction_controller`."""


ROVER_SIMULATOR = (
    ParameterSpec(
        "rover",
        "lsr1",
        "Rover that is simulated: a preset's name or a rover file.",
        read_only=True,
    ),
    ParameterSpec(
        "terrain_file",
        "",
        "Terrain it drives on, .npz; empty makes a Mars-like one.",
        read_only=True,
    ),
    ParameterSpec("start_x", 0.0, "Where it starts.", "m", bounds=(-1e6, 1e6), read_only=True),
    ParameterSpec("start_y", 0.0, "Where it starts.", "m", bounds=(-1e6, 1e6), read_only=True),
    ParameterSpec("start_yaw", 0.0, "Its heading.", "rad", bounds=(-6.3, 6.3), read_only=True),
    ParameterSpec(
        "engine",
        "quasi_static",
        "What moves it: the model itself, or MuJoCo (extra bench).",
        choices=("quasi_static", "mujoco"),
        read_only=True,
    ),
    ParameterSpec(
        "friction",
        0.0,
        "Coulomb friction of the ground; 0 takes the terrain's or the rover file's.",
        bounds=(0.0, 10.0),
        read_only=True,
    ),
    ParameterSpec(
        "speed",
        0.0,
        "Speed along a path; 0 takes the rover's nominal speed.",
        "m/s",
        bounds=(0.0, 10.0),
        read_only=True,
    ),
    ParameterSpec(
        "follow_commands",
        False,
        "Whether torques from /traction_controller/commands drive it; cmd_vel is published then, "
        "unless it comes from elsewhere.",
        read_only=True,
    ),
    ParameterSpec(
        "joints",
        list(WHEEL_JOINTS),
        "Wheel joints in the order of the values of the torques.",
        read_only=True,
    ),
    ParameterSpec(
        "timeout",
        0.5,
        "Age from which cmd_vel and torques count no more.",
        "s",
        bounds=(0.01, 10.0),
        read_only=True,
    ),
    ParameterSpec("rate", 50.0, "Steps per second.", "1/s", bounds=(5.0, 500.0), read_only=True),
    ParameterSpec("map_rate", 0.5, "Maps per second.", "1/s", bounds=(0.01, 20.0), read_only=True),
    ParameterSpec("sensor_range", 6.0, "How far it sees.", "m", bounds=(0.5, 1e3), read_only=True),
    ParameterSpec(
        "sensor_noise",
        0.0,
        "Standard deviation of the heights it sees; it goes with them as elevation_std.",
        "m",
        bounds=(0.0, 1.0),
        read_only=True,
    ),
    ParameterSpec(
        "sensor_height",
        0.8,
        "Height of the sensor over the body's origin.",
        "m",
        bounds=(0.0, 10.0),
        read_only=True,
    ),
    ParameterSpec(
        "sensor_occlusion",
        True,
        "Whether ground hides what is behind it.",
        read_only=True,
    ),
    ParameterSpec(
        "seed", 1, "Seed of noise and of a made terrain.", bounds=(0, 2**31 - 1), read_only=True
    ),
    ParameterSpec("map_frame", "map", "Frame of map, path and odometry.", read_only=True),
)
"""Parameters of `/rover_simulator`."""


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


def parameters_document() -> str:
    """Return the text of docs/parameters.md."""
    return "\n".join(
        [
            "# Parameters",
            "",
            "Made from the tables in `rover_planner/parameters.py` by",
            "`python -m rover_planner.parameters > docs/parameters.md`; "
            "a test holds them together.",
            "",
            "## /traverse_server",
            "",
            *_table(TRAVERSE_SERVER),
            "",
            "## /traction_controller",
            "",
            *_table(TRACTION_CONTROLLER),
            "",
            "## /rover_simulator",
            "",
            *_table(ROVER_SIMULATOR),
            "",
            "Read-only parameters are set at start, the others at any time "
            "(`ros2 param set /traverse_server friction 0.6`).",
            "A value of the wrong type, NaN, out of bounds or not among the choices "
            "is refused with the reason.",
            "",
        ]
    )


def _table(specs: Iterable[ParameterSpec]) -> list[str]:
    """Return the lines of a Markdown table of parameters."""
    lines = ["| name | type | default | allowed | meaning |", "|---|---|---|---|---|"]
    for spec in specs:
        default = f"`{spec.default}`" if spec.default != "" else "empty"
        name = f"`{spec.name}`" + (" (read-only)" if spec.read_only else "")
        lines.append(f"| {name} | {spec.type_name} | {default} | {_allowed(spec)} | {spec.doc} |")
    return lines


def _allowed(spec: ParameterSpec) -> str:
    """Return the bounds with their unit, or the choices."""
    if spec.bounds is not None:
        return f"{spec.bounds[0]:g} to {spec.bounds[1]:g} {spec.unit}".rstrip()
    return ", ".join(f"`{choice}`" for choice in spec.choices) or "any"


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


if __name__ == "__main__":
    print(parameters_document(), end="")
