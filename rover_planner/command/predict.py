# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner predict`: writes loads, slip and margins along a path to a file."""

import gc
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_physics.rover.uncertainty import ACCEPTED_CHANCE, SIGMAS
from rover_planner.command import shared
from rover_planner.command.shared import argument, flag, option, read_arm_angles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rover_physics.traversability.verdict import Verdict


def predict(
    rover: shared.RoverName,
    terrain: shared.TerrainName,
    poses: Annotated[
        Path,
        argument(
            "POSES", "Poses x, y, yaw of the body, .npz; with curvature, where they form no path."
        ),
    ],
    out: Annotated[Path, argument("OUT", "Predictions, .npz; is overwritten.")],
    friction: shared.Friction = None,
    max_torque: shared.MaxTorque = None,
    policy: shared.Policy = "equal",
    control_margin: Annotated[
        float,
        option(
            "SHARE", "Share of friction and torque that policy optimal leaves to the controller."
        ),
    ] = 0.0,
    soil: shared.SoilName = None,
    arm: shared.ArmAngles = None,
    payload: shared.Payload = None,
    tool_force: Annotated[
        shared.Vector | None, option("FX FY FZ", "Force on the arm's tip in N, body frame.")
    ] = None,
    tool_moment: Annotated[
        shared.Vector | None, option("MX MY MZ", "Moment on the arm's tip in N m, body frame.")
    ] = None,
    backward: Annotated[
        bool,
        flag(
            "--backward",
            "The rover drives backwards where poses do not tell: single ones, long steps.",
        ),
    ] = False,
    sigmas: shared.Sigmas = SIGMAS,
    classes: Annotated[
        bool, flag("--classes", "Add the class of each waypoint, by all torque policies.")
    ] = False,
    torque_ranges: Annotated[
        bool, flag("--torque-ranges", "Add the range of feasible torques of each wheel.")
    ] = False,
    chance: Annotated[
        bool, flag("--chance", "Add the chance that the path fails, and that each waypoint does.")
    ] = False,
    accepted_chance: Annotated[
        float | None,
        option(
            "P",
            f"As --chance; largest one of a path that is traversable (default {ACCEPTED_CHANCE}).",
            min=0,
            max=1,
        ),
    ] = None,
    learned: Annotated[
        Path | None, option("FILE", "Friction and its uncertainty as learned, .json of learn.")
    ] = None,
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> None:
    """Predict loads, slip and margins along a path, or at single poses, and write them to a file.

    Exit code 0: it ran, with any verdict. 2: bad input.
    """
    gc.disable()  # imports make no garbage; to look for it takes a tenth of a short command's time
    from rover_physics.prediction.path_kernels import LONGEST_STEP
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain
    from rover_planner.command.prediction_files import (
        AskedPoses,
        predict_to_file,
        read_curvature,
        read_poses,
    )
    from rover_planner.planning.learned_ground import lay_friction, read_learned
    from rover_planner.shell.progress import show_progress

    gc.freeze()
    gc.enable()
    shared.keep_inputs((rover, terrain, poses, learned), out)
    model, ground = load_rover(rover), load_terrain(terrain, max_cells)
    path = read_poses(poses)
    curvature = read_curvature(poses, len(path))
    options = SweepOptions(
        policy=policy,
        control_margin=control_margin,
        friction=friction,
        max_torque=max_torque,
        soil=soil,
        joint_angles=read_arm_angles(model, arm or ()),
        payload=payload,
        tool_force=tool_force,
        tool_moment=tool_moment,
        backward=backward,
    )
    if learned is not None:
        known, told = read_learned(learned), model.friction if friction is None else friction
        ground = lay_friction(ground, known.assume_classes(ground, told))
        model, options = known.change(model), replace(options, friction=known.assume(told))
    if accepted_chance is None and chance:
        accepted_chance = ACCEPTED_CHANCE
    asked = AskedPoses(
        model, ground, path, curvature, options, sigmas, accepted_chance, classes, torque_ranges
    )
    with show_progress() as progress:
        verdict = predict_to_file(out, asked, progress)
    typer.echo(f"wrote {out}: {_summarise(len(path), verdict)}")
    if curvature is None:
        _warn_of_long_steps(path, LONGEST_STEP * model.wheel.radius)


def _warn_of_long_steps(path: "NDArray[np.float64]", longest: float) -> None:
    """Warn of the longest step between poses (n, 3) if it is above a length [m]."""
    steps = [math.dist(one[:2], other[:2]) for one, other in pairwise(path.tolist())]
    step = max(steps, default=0.0)
    if step > longest:
        k = steps.index(step)
        typer.echo(
            f"warning: from waypoint {k} to {k + 1} it is {step:g} m; what lies between "
            f"waypoints is looked at if they are at most a wheel radius apart, {longest:g} m",
            err=True,
        )


def _summarise(count: int, verdict: "Verdict") -> str:
    """Return the number of waypoints and the verdict in words."""
    waypoints = f"{count} waypoint{'s' if count > 1 else ''}"
    if verdict.traversable:
        known = not math.isnan(verdict.failure_chance)
        chance = f" with a chance of failure of {verdict.failure_chance:.2f}" if known else ""
        return f"{waypoints}, traversable{chance}"
    return (
        f"{waypoints}, not traversable from waypoint {verdict.first_failure} on: {verdict.reason}"
    )
