# SPDX-License-Identifier: Apache-2.0
"""The node programs: their help, arguments and start; ROS is imported when one runs."""

import importlib
import itertools
import math
import re
import signal
import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import typer

from rover_planner.errors import PlanningError
from rover_planner.nodes.mission.drive import DriveSettings
from rover_planner.parameters.ground_learner import GroundLearnerParameters
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.parameters.table import ParameterSpec, specs_of
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.shell.extras import explain_import, need
from rover_planner.shell.poses import Pose, PoseCommand, pose_option
from rover_planner.shell.run_app import run_app
from rover_planner.shell.run_program import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_OK,
    end_with,
)

HELP_WORDS = ("-h", "--help")
_EXIT_CODES = "Exit code 0 when it was told to stop; 2 for a wrong parameter or missing library."

PLACE_IN_SOURCE = re.compile(r",? at /\S+:\d+")
"""Place of an error in the sources of ROS, which helps nobody."""


def read_nothing() -> dict[str, Any]:
    """Take no options, which set no parameters."""
    return {}


@dataclass(frozen=True)
class Program:
    """One of the node programs."""

    what: str
    """Its purpose, in one sentence."""
    topics: str
    """Its subscriptions, services and publishers, in one sentence."""
    parameters: tuple[ParameterSpec, ...] = ()
    """Its table of parameters."""
    read: Callable[..., Any] = read_nothing
    """Function whose arguments are the options, as typer expects; returns the options' values."""
    exit_codes: str = _EXIT_CODES
    """Meaning of its exit codes."""


def read_engine(
    engine: Annotated[
        str,
        typer.Option(
            metavar="quasi_static|mujoco", help="Physics engine; sets the parameter engine."
        ),
    ] = "",
) -> dict[str, Any]:
    """Return the parameters that the options of rover_simulator set."""
    return {"engine": engine} if engine else {}


@dataclass(frozen=True)
class MissionOptions:
    """The options of a mission planner; typer reads them, and their helps document them.

    Raises:
        PlanningError: The timeout or a tolerance is not above 0.
    """

    start: Annotated[Pose, pose_option("Where the rover stands, in m and rad.")]
    goal: Annotated[list[Pose], pose_option("Goal; may be given repeatedly.")]
    map_name: Annotated[
        str | None,
        typer.Option(
            "--map", metavar="TERRAIN", help="Map to publish first: preset (spirit) or .npz file."
        ),
    ] = None
    drive: Annotated[
        bool,
        typer.Option("--drive", help="Send each plan to the rover and wait until it is there."),
    ] = False
    advise: Annotated[
        bool,
        typer.Option(
            "--advise", help="Where a path is refused, take the first remedy that needs nobody."
        ),
    ] = False
    map_frame: Annotated[str, typer.Option(metavar="FRAME", help="Frame of map and poses.")] = (
        "map"
    )
    timeout: Annotated[
        float,
        typer.Option(
            metavar="S",
            help="Longest wait for an answer in s; a question without one is repeated each 10 s.",
        ),
    ] = 60.0
    as_json: Annotated[
        bool, typer.Option("--json", help="Print a JSON object a line; goals count from 1.")
    ] = False
    position_tolerance: Annotated[
        float, typer.Option(metavar="M", help="Distance from the goal that is there, in m.")
    ] = DriveSettings.position_tolerance
    heading_tolerance: Annotated[
        float, typer.Option(metavar="RAD", help="Difference from its heading that is there.")
    ] = DriveSettings.heading_tolerance

    def __post_init__(self) -> None:
        for name, what in (
            ("timeout", "a time above 0 in s"),
            ("position_tolerance", "a distance above 0 in m"),
            ("heading_tolerance", "an angle above 0 in rad"),
        ):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise PlanningError(f"{name} is {value}; it must be {what}")


PROGRAMS = {
    "traverse_server": Program(
        "Answer over ROS 2 whether the rover can traverse a path, and why not.",
        "subscribes elevation_cloud, elevation_map, joint_states, odometry, ~/path, "
        "~/ground_estimate, ~/mark_place, ~/tool_target, ~/tool_wrench; serves ~/can_traverse, "
        "~/check_path, ~/check_reach, ~/advise, ~/load_map, ~/cancel, ~/monitor, ~/clear_places, "
        "~/get_hazard_map; publishes "
        "~/stop, ~/watch, ~/advice, "
        "~/hazard_map/worst, ~/hazard_map/best, ~/plan, ~/verdict, diagnostics, "
        "~/predicted_joints, ~/wheel_loads, ~/slip_ratios, ~/friction_utilisation, "
        "~/torque_saturation, ~/tip_over_margin, ~/closed_area, ~/search_progress, "
        "~/map, ~/markers",
        specs_of(TraverseServerParameters),
    ),
    "traction_controller": Program(
        "Share the wheel torques by a quadratic program at its rate.",
        "subscribes joint_states, imu, cmd_vel, odometry, elevation_cloud, ~/emergency_stop, "
        "traverse_server/stop; serves ~/enable; publishes ~/commands, ~/velocity_commands, "
        "~/steering_commands, ~/brake, ~/state, ~/wheel_loads, ~/friction_utilisation, "
        "~/contact_angles, diagnostics",
        specs_of(TractionControllerParameters),
    ),
    "rover_simulator": Program(
        "Simulate a rover on a terrain, with the topics of a real one.",
        "subscribes path, cmd_vel, traction_controller/commands, traction_controller/brake, "
        "traverse_server/stop; "
        "publishes joint_states, odometry, imu, elevation_cloud, cmd_vel, path_driven, "
        "diagnostics",
        specs_of(RoverSimulatorParameters),
        read_engine,
    ),
    "ground_learner": Program(
        "Learn friction, slip and sticking while a rover drives.",
        "subscribes joint_states, imu, odometry, cmd_vel, elevation_cloud; publishes ~/odometry, "
        "traverse_server/ground_estimate, traverse_server/mark_place, "
        "traction_controller/emergency_stop",
        specs_of(GroundLearnerParameters),
    ),
    "mission_planner": Program(
        "Query a traverse_server over ROS 2 for a list of goals.",
        "calls traverse_server/can_traverse, traverse_server/check_path, traverse_server/advise; "
        "subscribes traverse_server/verdict, traverse_server/wheel_loads, "
        "traverse_server/slip_ratios, odometry, path_driven; publishes "
        "elevation_cloud, path, traverse_server/path",
        read=MissionOptions,
        exit_codes="Exit code 0: every goal is traversable, and with --drive was reached. 1: a "
        "question was refused before any path was judged, or the rover did not get there. 2: bad "
        "input, or a missing library. 3: a goal is not traversable. 4: no server, or no answer in "
        "time.",
    ),
}
"""The node programs by name."""


def read_arguments(name: str, argv: Sequence[str] | None) -> Any:
    """Return the values of a node program's options; ROS arguments are checked and removed.

    Args:
        name: One of PROGRAMS.
        argv: Its arguments; None takes those of the process.

    Returns:
        What the program's `read` returns; 0, an exit code, after help was printed.

    Raises:
        PlanningError: An argument is invalid; ROS arguments included.
    """
    from rclpy.utilities import remove_ros_args

    given = sys.argv[1:] if argv is None else list(argv)
    _refuse_old_remappings(given)
    try:
        own = remove_ros_args([name, *given])[1:]
    except RuntimeError as error:  # rclpy raises several classes that it does not export
        raise PlanningError(PLACE_IN_SOURCE.sub("", str(error))) from error
    return run_app(make_app(name), name, own)


def _refuse_old_remappings(argv: Sequence[str]) -> None:
    """Refuse NAME:=VALUE without --ros-args, which ROS reads as a remapping, not a parameter."""
    for word in itertools.takewhile(lambda word: word != "--ros-args", argv):
        if ":=" in word:
            raise PlanningError(
                f"{word} has no meaning without --ros-args: set a parameter by --ros-args -p "
                "NAME:=VALUE, remap a topic by --ros-args -r NAME:=NAME"
            )


def make_app(name: str) -> typer.Typer:
    """Return the typer app that reads a program's arguments and prints its help."""
    program = PROGRAMS[name]
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    app.command(
        name,
        cls=PoseCommand,
        help=f"{program.what}\n\n{program.exit_codes}",
        epilog="\n\n".join(_epilog(program)),
        options_metavar="[OPTIONS] [--ros-args -p NAME:=VALUE ...]",
        context_settings={"help_option_names": list(HELP_WORDS), "max_content_width": 99},
    )(program.read)
    return app


def _epilog(program: Program) -> list[str]:
    """Return the paragraphs of the help that follow the options."""
    topics = f"Topics and services: {program.topics}."
    if not program.parameters:
        return [topics]
    as_they_are = "\b"  # click keeps the line breaks of a paragraph that starts with it
    lines = [as_they_are, "Parameters, each set by --ros-args -p NAME:=VALUE:"]
    for spec in program.parameters:
        lines += _indent(f"{spec.name}: {_describe(spec)}", 2, 10)
        lines += _indent(spec.meaning, 6, 6)
    return [topics, "\n".join(lines)]


def _indent(text: str, first: int, others: int) -> list[str]:
    """Wrap a text; indent the first line and the other lines by numbers of blanks."""
    return textwrap.wrap(
        text,
        88,
        initial_indent=first * " ",
        subsequent_indent=others * " ",
        break_on_hyphens=False,
    )


def _describe(spec: ParameterSpec) -> str:
    """Return type, default, unit and allowed values of a parameter."""
    default = "empty" if spec.default == "" else str(spec.ros_default)
    words = [spec.type_name, f"default {default} {spec.unit}".rstrip()]
    if spec.bounds is not None:
        words.append(f"{spec.bounds[0]:g} to {spec.bounds[1]:g}")
    if spec.choices:
        words.append("one of " + ", ".join(spec.choices))
    return ", ".join(words)


def _start(name: str, stopped: int = EXIT_OK) -> int:
    """Run a node program and return its exit code, `stopped` if it is told to stop at once."""
    if not set(HELP_WORDS).isdisjoint(sys.argv[1:]):
        run_app(make_app(name), name, HELP_WORDS[-1:])
        return EXIT_OK
    for number in (signal.SIGINT, signal.SIGTERM):  # until the node has its own handlers
        signal.signal(number, signal.default_int_handler)
    try:
        need("rclpy", "the node")
        module = importlib.import_module(f"rover_planner.nodes.{name}")
    except PlanningError as error:
        return end_with(name, EXIT_BAD_INPUT, str(error))
    except ImportError as error:  # rclpy of another Python, or only a part of ROS
        return end_with(name, EXIT_BAD_INPUT, explain_import(error, "the node"))
    except KeyboardInterrupt:  # told to stop before it began
        return stopped
    return module.main()


start_traverse_server = partial(_start, "traverse_server")
start_traction_controller = partial(_start, "traction_controller")
start_rover_simulator = partial(_start, "rover_simulator")
start_ground_learner = partial(_start, "ground_learner")
start_mission_planner = partial(_start, "mission_planner", EXIT_INTERRUPTED)
