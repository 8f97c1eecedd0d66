"""Compilation of the kernels of predictions, verdicts and bounds, or their loading from disk."""

from dataclasses import replace

import numpy as np

from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_path import judge_path


def warm_up() -> None:
    """Compile the kernels, or load them from disk, by judging short paths up and down a step."""
    rover, layer = load_rover("lsr1"), np.ones((64, 64))
    step = Terrain(np.where(np.arange(64) > 40, 0.1, 0.0) * layer, 0.05, (-1.6, -1.6))
    poses = np.zeros((8, 3))
    poses[:, 0] = np.linspace(-0.12, 0.02, 8)
    judge_path(rover, replace(step, friction=layer, elevation_std=layer), poses)
    judge_path(rover, step, poses, SweepOptions(soil="mars_simulant"))
    down = SweepOptions(backward=True)
    judge_path(rover, step, poses[::-1], down, stop_at_failure=True)


if __name__ == "__main__":
    warm_up()
