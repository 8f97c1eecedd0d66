# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner reach`: whether the arm of a rover at rest reaches a point."""

import json
from typing import Annotated

import typer

from rover_planner.command import shared
from rover_planner.command.shared import argument, option


def reach(
    rover: shared.RoverName,
    terrain: shared.TerrainName,
    x: Annotated[float, argument("X", "Position of the body in m, map frame.")],
    y: Annotated[float, argument("Y")],
    yaw: Annotated[float, argument("YAW", "Heading of the body in rad.")],
    tx: Annotated[float, argument("TX", "Target for the tip in m, map frame.")],
    ty: Annotated[float, argument("TY")],
    tz: Annotated[float, argument("TZ")],
    force: Annotated[
        shared.Vector | None, option("FX FY FZ", "Force on the tip there in N, map frame.")
    ] = None,
    moment: Annotated[
        shared.Vector | None, option("MX MY MZ", "Moment on the tip there in N m, map frame.")
    ] = None,
    payload: shared.Payload = None,
    friction: shared.Friction = None,
    max_torque: shared.MaxTorque = None,
    policy: shared.Policy = "equal",
    soil: shared.SoilName = None,
    max_cells: shared.MaxCells = shared.MAX_CELLS,
) -> None:
    """Print as JSON whether the rover at rest can reach a point with its arm and push there.

    Exit code 0: it ran, with any answer. 2: bad input.
    """
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain
    from rover_physics.traversability.reach import judge_reach
    from rover_planner.shell.progress import show_progress

    model, ground = load_rover(rover), load_terrain(terrain, max_cells)
    with show_progress() as progress:
        progress(f"ask {model.name} (the first run compiles the model)")
        answer = judge_reach(
            model,
            ground,
            (x, y, yaw),
            (tx, ty, tz),
            SweepOptions(
                payload=payload, friction=friction, max_torque=max_torque, policy=policy, soil=soil
            ),
            force=force,
            moment=moment,
        )
    typer.echo(json.dumps(answer.to_dict(), allow_nan=False))
