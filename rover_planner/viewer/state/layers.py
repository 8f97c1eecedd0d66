# SPDX-License-Identifier: Apache-2.0
"""Layers that colour the ground: its shape, its friction, and the uses of the rover's limits."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rover_physics.limits.table import LIMITS
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.record import QUANTITIES
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

STEEP = 35.0
"""Slope of the last colour [deg]."""
HEIGHT, SLOPE, FRICTION = "height", "slope", "friction of the ground"
"""Layers of the ground alone."""
_OF_PATHS = [one.name for one in QUANTITIES if one.of_path]
PREDICTED: Mapping[str, str] = {"use of all limits": ""} | {
    f"use of {row.title}": row.code for row in LIMITS[::-1] if row.reads not in _OF_PATHS
}
"""Layers that the model predicts for the rover: the code of the limit, empty for all of them."""


@dataclass(frozen=True)
class Colouring:
    """What the ground is coloured by."""

    layer: str = HEIGHT
    """Name of the layer."""
    heading: float = 0.0
    """Heading of the rover for predicted layers [deg]."""
    along: bool = False
    """True if they are for the heading of the path instead."""

    @property
    def is_predicted(self) -> bool:
        """True if the layer is predicted for the rover."""
        return self.layer in PREDICTED

    def describe(self) -> str:
        """Return what the colours are of, in words."""
        if not self.is_predicted:
            return self.layer
        at = "along the path" if self.along else f"at heading {self.heading:g} deg"
        return f"{self.layer} {at}"


def list_layers(terrain: Terrain) -> list[str]:
    """Return the names of the layers of a ground; the friction only where its map has one."""
    friction = [] if terrain.friction is None else [FRICTION]
    return [HEIGHT, SLOPE, *friction, *PREDICTED]


def compute_slope(x: Floats, y: Floats, heights: Floats) -> Floats:
    """Return the slope (ny, nx) [deg] of heights (ny, nx) [m] at x (nx,) and y (ny,) [m]."""
    along_y, along_x = np.gradient(heights, y, x)
    return np.asarray(np.degrees(np.arctan(np.hypot(along_x, along_y))))


def predict_use(
    code: str,
    rover: Rover,
    terrain: Terrain,
    heading: float | Floats,
    at: tuple[Floats, Floats],
    options: SweepOptions,
) -> Floats:
    """Return the use of a limit with the rover at each point.

    Args:
        code: Code of the limit; empty for the largest use of all limits.
        rover: The rover.
        terrain: The ground.
        heading: Yaw of the body [rad]; or a path (n, 3) whose yaw at the nearest waypoint it has.
        at: x (nx,) and y (ny,) of the points [m].
        options: Options of the model.

    Returns:
        Uses (ny, nx), NaN where the rover does not settle or the limit is not asked.

    Raises:
        RoverError: The model refuses an option.
    """
    x, y = np.meshgrid(*at)
    poses = np.stack([x, y, _headings(x, y, heading)], axis=-1)
    scores = score_poses(rover, terrain, poses, options)
    of_limit = [code in ("", row.code) for row in scores.limits.rows]
    used = np.fmax.reduce(scores.uses[..., of_limit], axis=-1, initial=np.nan)
    return np.where(scores.status == PoseStatus.SETTLED, used, np.nan)


def _headings(x: Floats, y: Floats, heading: float | Floats) -> Floats:
    """Return the yaw (ny, nx) of the body at places."""
    if isinstance(heading, float):
        return np.full_like(x, heading)
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(heading[:, :2]).query(np.stack([x, y], axis=-1))
    return np.asarray(heading[nearest, 2])
