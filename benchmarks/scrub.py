"""Torques of a rover that steers along an arc on level ground: scrub of its wheels, in MuJoCo too.

Run from the repository: python -m benchmarks.scrub
It needs the extra `bench`. Its results are in docs/validation.md.
"""

import re
from dataclasses import replace
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table

from rover_physics.prediction.sweep import sweep_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.terrain.grid import Terrain
from rover_planner.simulator import mujoco_rover
from rover_planner.simulator.mujoco_model import write_model
from rover_planner.simulator.mujoco_rover import TIMESTEP, MujocoRover
from support.reference_drives import drive_ground

SPEED, CURVATURE, FRICTION = 0.06, 1.0, 0.8
"""Speed [m/s], curvature [1/m] and friction of the drives."""
PERIOD, STEERING_TIME = 0.02, 6.0
"""Time between two samples, and time for the wheels to steer before the drive [s]."""
DURATION, START_UP = 16.0, 4.0
"""Length of a drive, and of its beginning that is left out [s]."""
STEADY = {
    r'<geom name="ground"[^>]*/>': '<geom name="ground" type="plane" size="5 5 1"/>',
    r'solimp="0.97 0.995 0.0005"': 'solimp="0.9 0.95 0.001"',
}
"""What makes the loads in MuJoCo steady: a plane instead of a height field, softer contacts."""


def with_width(rover: Rover, width: float) -> Rover:
    """Return the rover with another wheel width [m]."""
    return replace(rover, wheel=replace(rover.wheel, width=width))


def predict(rover: Rover) -> np.ndarray:
    """Return the torques (6,) of the model [N m]."""
    options = SweepOptions(policy="servo", friction=FRICTION)
    return np.asarray(sweep_poses(rover, level(), np.zeros((1, 3)), [CURVATURE], options).torque)


def level() -> Terrain:
    """Return level ground."""
    return drive_ground("step", 0.0)


def write_steady_model(rover: Rover, terrain: Terrain, friction: float, timestep: float) -> str:
    """Return the MJCF text of a rover whose wheel loads are steady on level ground."""
    text = write_model(rover, terrain, friction, timestep)
    for pattern, new in STEADY.items():
        text, count = re.subn(pattern, new, text)
        if not count:
            raise ValueError(f"the model has no {pattern}")
    return text


def drive(rover: Rover, timestep: float = TIMESTEP, steady: bool = False) -> np.ndarray:
    """Return torques (n, 6) along an arc in MuJoCo [N m], one row each PERIOD."""
    write = write_steady_model if steady else write_model
    with patch.object(mujoco_rover, "write_model", write):
        plant = MujocoRover(rover, level(), friction=FRICTION, timestep=timestep)
    aims = SteeredDrive(rover).aim(SPEED, CURVATURE * SPEED)
    plant.steer(aims.angles)
    plant.servo(np.zeros(6), STEERING_TIME)
    rates, droop = aims.speeds / rover.wheel.radius, rover.wheel.servo_droop
    rows = [plant.servo_with_droop(rates, droop, PERIOD) for _ in range(round(DURATION / PERIOD))]
    return np.array(rows[round(START_UP / PERIOD) :])


def main() -> None:
    """Run all drives and print a table."""
    rover = replace(load_rover("lsr1"), nominal_speed=SPEED)
    width = rover.wheel.width
    cases = {
        "model": predict(rover),
        "model, scrub points at the edges": predict(with_width(rover, np.sqrt(3.0) * width)),
        "MuJoCo, steady contacts": drive(rover, steady=True),
        **{f"MuJoCo, {1e3 * step:g} ms": drive(rover, step) for step in (0.004, 0.002, 0.001)},
        "MuJoCo, wheels 2 mm wide": drive(with_width(rover, 0.002)),
    }
    table = Table(title="LSR-1 on an arc of 1 m radius: torques [N m]")
    for heading in ("", "sum of the means", "mean size", "means: rear, middle, front"):
        table.add_column(heading)
    for name, torques in cases.items():
        means = torques.mean(axis=0)
        table.add_row(
            name, f"{means.sum():.3f}", f"{np.abs(torques).mean():.3f}",
            " ".join(f"{mean:.3f}" for mean in means),
        )  # fmt: skip
    console = Console()
    console.width = max(console.width, 120)
    console.print(table)


if __name__ == "__main__":
    main()
