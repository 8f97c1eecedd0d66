# SPDX-License-Identifier: Apache-2.0
"""The command-line options of the program mission_planner; needs no ROS."""

import math
from dataclasses import dataclass
from typing import Annotated

import typer

from rover_planner.errors import PlanningError
from rover_planner.nodes.mission.drive import DriveSettings
from rover_planner.shell.poses import Pose, pose_option


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
