# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner learn`: learns the ground from a recorded drive."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_planner.command import shared
from rover_planner.command.shared import argument, option, picture_option
from rover_planner.shell.extras import need

if TYPE_CHECKING:
    from rover_physics.numerics.arrays import Floats
    from rover_physics.rover.model import Rover
    from rover_planner.learning.ground_learner import GroundEstimate

CSV = ".csv"
"""Suffix of a drive that is no bag."""


def learn(
    rover: shared.RoverName,
    terrain: shared.TerrainName,
    log: Annotated[Path, argument("LOG", "The drive: a CSV file, or a bag.")],
    out: Annotated[Path, argument("OUT", "What was learned, .json; is overwritten.")],
    picture: Annotated[
        Path | None, picture_option("Draw it along the way, .png, .svg or .pdf.")
    ] = None,
    ground: Annotated[
        Path | None, option("FILE", "Write the terrain with layers friction, friction_std, .npz.")
    ] = None,
    friction: Annotated[
        float | None, option("MU", "Friction that is assumed at first; default: the rover's.")
    ] = None,
    soil: Annotated[
        str | None,
        option("NAME", "Soil that is assumed at first, on ground that yields; it is learned."),
    ] = None,
    odometry_topic: Annotated[
        str, option("TOPIC", "Odometry of a bag that does not come from the wheels.")
    ] = "",
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> None:
    """Learn friction, slip and sticking from a recorded drive, and write them to a file.

    Exit code 0: it ran. 2: bad input.
    """
    import numpy as np

    from rover_physics.files.user_file import write_file
    from rover_physics.files.validation import errors_of
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain, save_terrain
    from rover_planner.errors import PlanningError
    from rover_planner.learning.drive_faults import check_angles, explain_nothing
    from rover_planner.learning.drive_log import X, Y
    from rover_planner.learning.ground_learner import GroundLearner
    from rover_planner.learning.learned_file import describe
    from rover_planner.shell.progress import show_bar

    shared.keep_inputs((rover, terrain, log), out, ground, picture)
    model, map_ = load_rover(rover), load_terrain(terrain, max_cells)
    told = model.friction if friction is None else friction
    if not 0.0 < told < np.inf:
        raise PlanningError(f"--friction is {told:g}; it must be above 0")
    rows = _read_log(log, model, odometry_topic)
    check_angles(rows, log)
    learner = GroundLearner(model, map_, told, soil)
    places, estimates = [], []
    with show_bar("learn", len(rows)) as step:
        for row in rows:
            if learner.take(row):
                places.append(row[[X, Y]])
                if picture is not None:
                    estimates.append(learner.estimate)
            step()
    if not places:
        raise PlanningError(f"{log}: nothing can be learned: {explain_nothing(rows, model)}")
    with errors_of(out, PlanningError):
        contents = json.dumps(describe(learner.estimate, told), indent=1)
        write_file(out, f"{contents}\n".encode())
    mean, std = learner.layers
    if ground is not None:
        known = mean if map_.friction is None else map_.friction
        learned_map = replace(map_, friction=np.where(np.isfinite(mean), mean, known))
        save_terrain(ground, learned_map, friction_std=std)
    if picture is not None:
        from rover_planner.figures.path_pictures import draw_learning

        draw_learning(picture, map_, np.array(places), estimates, mean)
    typer.echo(f"wrote {out}: {_summarise(learner.estimate)}")
    if learner.estimate.faults:
        faults = ", ".join(f"{wheel} {word}" for wheel, word in learner.estimate.faults.items())
        typer.echo(f"warning: sensors that were not believed: {faults}", err=True)


def _summarise(learned: "GroundEstimate") -> str:
    """Return friction and what is known of the soil in words."""
    found = learned.friction
    high = "not bounded above" if found.high is None else f"at most {found.high:.2f}"
    told = f"friction {found.mean:.2f}, at least {found.low:.2f}, {high}"
    if learned.soil is None:
        return told
    sunk, strength = learned.soil.sinkage[0], learned.soil.strength[0]
    return f"{told}; sinkage {1e3 * sunk:.1f} mm, strength {strength:.2f} of the load"


def _read_log(path: Path, rover: "Rover", odometry_topic: str) -> "Floats":
    """Return the rows of a CSV file or a bag."""
    if path.suffix.lower() == CSV or (path.is_file() and path.suffix not in (".mcap", ".db3")):
        from rover_planner.learning.drive_log import read_csv

        return read_csv(path, rover.wheel.torque_per_current)
    need("rclpy", "learn from a bag")
    need("rosbags", "learn from a bag")
    from rover_planner.ros.bags.bag_files import read_rows

    return read_rows(path, odometry_topic)
