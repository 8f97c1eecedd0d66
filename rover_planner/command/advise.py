# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner advise`: the smallest changes that make a refused path pass."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_physics.rover.uncertainty import ACCEPTED_CHANCE, SIGMAS
from rover_planner.command import shared
from rover_planner.command.shared import argument, option, picture_option, read_arm_angles

if TYPE_CHECKING:
    from rover_planner.advice.advise import Advice


def advise(
    rover: shared.RoverName,
    terrain: shared.TerrainName,
    poses: Annotated[
        Path,
        argument("POSES", "A refused path: poses x, y, yaw, .npz; two far apart: start and goal."),
    ],
    out: Annotated[Path, argument("OUT", "The remedies, .json; is overwritten.")],
    policy: shared.Policy = "equal",
    friction: shared.Friction = None,
    max_torque: shared.MaxTorque = None,
    soil: shared.SoilName = None,
    arm: shared.ArmAngles = None,
    payload: shared.Payload = None,
    sigmas: shared.Sigmas = SIGMAS,
    accepted_chance: shared.AcceptedChance = ACCEPTED_CHANCE,
    budget: Annotated[float, option("S", "Time for the advice in s.", min=0.01)] = 10.0,
    picture: Annotated[
        Path | None, picture_option("Draw the remedies on the map (.png, .svg).")
    ] = None,
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> None:
    """Find the smallest changes that make a refused path pass; write them as JSON.

    Exit code 0: it ran, with any answer. 2: bad input.
    """
    from rover_physics.numerics.interruption import interruptible
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain
    from rover_planner.advice.advise import STOPPED, grow_advice, path_of, refuse
    from rover_planner.advice.case import Case
    from rover_planner.command.prediction_files import read_poses
    from rover_planner.nodes.warm_up import prepare_search
    from rover_planner.planning.answering.budget import Budget, QuestionStoppedError
    from rover_planner.planning.path_query import PathQueryOptions, waypoint_spacing_for
    from rover_planner.planning.search.query import Site
    from rover_planner.shell.progress import show_progress

    shared.keep_inputs((rover, terrain, poses), out, picture)
    model = load_rover(rover)
    options = PathQueryOptions(
        model=SweepOptions(
            policy=policy,
            friction=friction,
            max_torque=max_torque,
            soil=soil,
            joint_angles=read_arm_angles(model, arm or ()),
            payload=payload,
        ),
        map_sigmas=sigmas,
        accepted_chance=accepted_chance,
    )
    path = path_of(model, read_poses(poses), waypoint_spacing_for(model))
    site = Site(model, load_terrain(terrain, max_cells), options)
    case = Case(site, path)
    advice = None
    try:
        with show_progress() as progress:
            progress("load the model (the first run compiles it)")
            prepare_search(site)
            with interruptible(Budget(budget).check):
                for advice in grow_advice(case):
                    progress(f"{len(advice.found)} remedies; tried {' and '.join(advice.tried)}")
    except KeyboardInterrupt:
        if advice is None or not advice.found:
            typer.echo(STOPPED, err=True)
        raise
    except QuestionStoppedError as error:
        _write(out, refuse(error.code, str(error)))
        typer.echo(f"{error}; a larger --budget tries more")
        return
    assert advice is not None
    _write(out, advice.to_dict())
    if picture is not None:
        from rover_planner.figures.path_pictures import draw_advice

        draw_advice(picture, advice, Path(terrain).name)
    _print_table(advice)


def _write(out: Path, report: dict[str, Any]) -> None:
    from rover_physics.files.user_file import write_file
    from rover_physics.files.validation import errors_of
    from rover_planner.errors import PlanningError

    with errors_of(out, PlanningError):
        contents = json.dumps(report, indent=1, allow_nan=False)
        write_file(out, f"{contents}\n".encode())


def _print_table(advice: "Advice") -> None:
    """Print what is refused and a line for each remedy."""
    if advice.judged.verdict.reason:
        typer.echo(f"refused: {advice.judged.verdict.reason}")
    for number, remedy in enumerate((*advice.remedies, *advice.others), start=1):
        typer.echo(f"{number}. {remedy.describe()} [{remedy.describe_costs()}]")
    if not advice.found:
        typer.echo(advice.describe())
    if not advice.complete:
        typer.echo("not all levers were tried in this time; a larger --budget tries more")
