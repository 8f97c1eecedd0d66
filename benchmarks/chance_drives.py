# SPDX-License-Identifier: Apache-2.0
"""Paths of the LSR-1, each driven in MuJoCo with friction and torque limit drawn around the told.

Run from the repository: python -m benchmarks.chance_drives FILE [--seed S] [--paths N] [--draws M]
It needs the extra `bench`. The file gets a line of JSON for each path; lines that it has are kept.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.chance import FAST, ChancePath, draw_path, draw_truths, read_driven_paths
from benchmarks.drives import LOOK_AHEAD
from rover_planner.simulator.mujoco_rover import MAX_TILT, MujocoRover
from rover_planner.simulator.path_follower import PathFollower
from support.reference_drives import KEPT

PERIOD = 0.04
"""Period of the steering [s]."""
STUCK_WAY, ASKED_WAY = 0.03, 0.8
"""A rover that goes less than the first way [m] while it is asked to go the second is stuck."""


def passes(path: ChancePath, friction: float, max_torque: float) -> bool:
    """Drive a path with speed servos with droop and a follower; return whether it arrives.

    The follower aims at LOOK_AHEAD beyond the last pose. Friction coefficient and torque limit
    [N m] are the true ones, which a planner is not told.
    """
    rover, poses = path.rover(max_torque), path.poses
    x, y, yaw = poses[-1]
    beyond = [x + LOOK_AHEAD * np.cos(yaw), y + LOOK_AHEAD * np.sin(yaw), yaw]
    plant = MujocoRover(rover, path.ground, tuple(poses[0]), friction)
    follower = PathFollower(np.vstack([poses, beyond]), LOOK_AHEAD)
    length = float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())
    within, is_lost, way = round(ASKED_WAY / path.speed / PERIOD), False, [0.0]
    while follower.driven < length and not is_lost:
        here = plant.pose()
        speeds = plant.steer(follower.steer(here, rover.nominal_speed))
        plant.servo_with_droop(speeds / rover.wheel.radius, rover.wheel.servo_droop, PERIOD)
        way.append(follower.driven)
        stands = len(way) > within and way[-1] - way[-1 - within] < STUCK_WAY
        is_lost = plant.tilt > MAX_TILT or stands
    off = np.hypot(*(plant.pose()[:2] - poses[-1, :2]))
    return not is_lost and bool(off <= KEPT)


def main(
    file: Annotated[Path, typer.Argument(help="File of the drives.")],
    seed: Annotated[int, typer.Option(help="Seed of the paths.")] = 1,
    paths: Annotated[int, typer.Option(help="Number of paths.")] = 40,
    draws: Annotated[int, typer.Option(help="Draws of friction and torque limit per path.")] = 20,
    speed: Annotated[float, typer.Option(help="Nominal speed [m/s].")] = FAST,
) -> None:
    """Drive the paths that the file does not have."""
    file.touch()
    known = {path.number for path in read_driven_paths(file) if path.stream == seed}
    for number in sorted({*range(paths)} - known):
        path = replace(draw_path(seed, number), speed=speed)
        truths = draw_truths(seed, number, path, draws).tolist()
        passed = "".join("01"[passes(path, *truth)] for truth in truths)
        line = json.dumps(asdict(path) | {"stream": seed, "number": number, "passed": passed})
        with file.open("a") as target:
            target.write(line + "\n")
        print(line, flush=True)


if __name__ == "__main__":
    typer.run(main)
