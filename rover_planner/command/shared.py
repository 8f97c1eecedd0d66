# SPDX-License-Identifier: Apache-2.0
"""The table of arguments and options that several subcommands share, and how others are made."""

import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need

if TYPE_CHECKING:
    from rover_physics.rover.model import Rover


def argument(metavar: str, help: str = "") -> Any:
    """Return an argument of typer."""
    return typer.Argument(metavar=metavar, help=help or None)


def option(metavar: str, help: str, *names: str, **more: Any) -> Any:
    """Return an option of typer that takes a value; without names it has that of its parameter."""
    return typer.Option(*names, metavar=metavar, help=help, **more)


def flag(name: str, help: str) -> Any:
    """Return an option of typer that takes no value."""
    return typer.Option(name, help=help)


def picture_option(help: str) -> Any:
    """Return an option that takes the file of a picture, which is checked before long work."""
    return option("FILE", help, callback=_check_picture)


def _check_picture(path: Path | None) -> Path | None:
    if path is not None:
        need("matplotlib", "the picture")
        from rover_planner.figures.pictures import check_picture

        check_picture(path)
    return path


Vector = tuple[float, float, float]
_ROVER = "Preset name (lsr1, m2020) or rover file."
_TERRAIN = "Preset name (spirit) or elevation map, .npz"
_OPTIONAL = f"{_TERRAIN}; default: a generated one."

RoverName = Annotated[str, argument("ROVER", _ROVER)]
RoverOption = Annotated[str, typer.Option(help=_ROVER)]
TerrainName = Annotated[str, argument("TERRAIN", f"{_TERRAIN}.")]
OptionalTerrain = Annotated[str | None, argument("TERRAIN", _OPTIONAL)]
OptionalMap = Annotated[str | None, option("TERRAIN", _OPTIONAL, "--map")]
Friction = Annotated[
    float | None,
    option("MU", "Coulomb friction where the map has no friction layer; default: the rover's."),
]
MaxTorque = Annotated[
    float | None, option("TAU", "Largest wheel torque in N m; default: the rover's.")
]
Policy = Annotated[str, option("equal|servo|optimal", "How the wheels share the traction.")]
SoilName = Annotated[
    str | None,
    option(
        "NAME",
        "Preset soil (docs/soil.md) where the terrain names none; default: Coulomb friction.",
    ),
]
Payload = Annotated[
    float | None, option("KG", "Mass at the arm's tip in kg; default: the rover's.")
]
ArmAngles = Annotated[
    list[str] | None,
    option("NAME=RAD", "Angle of a joint of the arm in rad; give all; default: stowed."),
]
Sigmas = Annotated[
    float,
    option("K", "Standard deviations to allow for where the map has elevation_std; 0: none."),
]
AcceptedChance = Annotated[
    float,
    option("P", "Largest chance of failure, 0 to 1, of a path that is traversable.", min=0, max=1),
]
MaxGap = Annotated[
    float, option("M", "Widest unknown region of the map to interpolate in m; 0: none.")
]
MaxCells = Annotated[
    int, option("N", "Largest terrain file in cells; more are not unpacked.", min=4)
]
MAX_CELLS = 25_000_000
"""Default of the option --max-cells; a test compares it with that of `load_terrain`."""


def keep_inputs(inputs: Iterable[str | Path | None], *outputs: Path | None) -> None:
    """Check that no file that a command writes is one that it reads, or writes already.

    Raises:
        PlanningError: One is.
    """
    known = {os.path.realpath(file) for file in inputs if file is not None}
    for file in filter(None, outputs):
        path = os.path.realpath(file)
        if path in known and path != os.devnull:
            raise PlanningError(
                f"{show_file(file)} is named twice and would be overwritten; write to another file"
            )
        known.add(path)


def read_arm_angles(rover: "Rover", words: Sequence[str]) -> dict[str, float] | None:
    """Return the angles [rad] of all arm joints by name; None (stowed) if `words` is empty.

    Args:
        rover: The rover.
        words: NAME=RAD for each joint of the arm, each joint once, in any order.

    Raises:
        PlanningError: The rover has no arm, a word has another form, an angle is not finite, or
            a joint is unknown, named twice or missing.
    """
    if not words:
        return None
    arm = rover.manipulator
    if arm is None:
        raise PlanningError(f"--arm {words[0]}: rover {rover.name!r} has no manipulator")
    known = ", ".join(arm.joints)
    angles: dict[str, float] = {}
    for word in words:
        name, _, text = word.partition("=")
        try:
            angle = float(text)
        except ValueError:
            angle = math.nan
        if not math.isfinite(angle):
            raise PlanningError(
                f"--arm is {word!r}; it must be NAME=RAD, such as {arm.joints[0]}=0.5"
            )
        if name not in arm.joints:
            raise PlanningError(f"--arm {word}: no joint {name!r}; joints are {known}")
        if name in angles:
            raise PlanningError(f"--arm names {name} twice")
        angles[name] = angle
    missing = [name for name in arm.joints if name not in angles]
    if missing:
        raise PlanningError(f"--arm lacks {', '.join(missing)}; give all joints: {known}")
    return angles
