"""Compilation of the kernels of predictions and bounds, or their loading from the cache."""

from dataclasses import replace

import numpy as np

from rover_physics.bounds.path import bound_path
from rover_physics.prediction.sweep import sweep_path
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, by a short prediction up a step."""
    rover, layer = load_rover("lsr1"), np.ones((64, 64))
    step = Terrain(np.where(np.arange(64) > 40, 0.1, 0.0) * layer, 0.05, (-1.6, -1.6))
    poses = np.zeros((8, 3))
    poses[:, 0] = np.linspace(-0.12, 0.02, 8)
    for ground in (step, replace(step, friction=layer, elevation_std=layer)):
        bound_path(rover, ground, sweep_path(rover, ground, poses))


if __name__ == "__main__":
    warm_up()
