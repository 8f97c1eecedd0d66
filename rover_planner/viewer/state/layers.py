# SPDX-License-Identifier: Apache-2.0
"""Layers that colour the ground: its shape, and what the model predicts at each cell."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.limits.table import LIMITS, Limit
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain

STEEP = 35.0
"""Slope of the last colour [deg]."""


@dataclass(frozen=True)
class Layer:
    """One layer: its unit, its values and the range of its colours."""

    unit: str = ""
    """Unit for the scale, empty for none."""
    scores: str = ""
    """Field of `PoseScores` that has the values; empty for layers of the ground alone."""
    limit: Limit | None = None
    """Limit of the values; None for none."""
    top: Callable[[Rover], float] | None = None
    """Value of the last colour [unit], that of the first is the limit or 0; None: from 0 to the
    limit, or from the smallest value to the largest."""

    @property
    def is_predicted(self) -> bool:
        """True if the model predicts it for the rover."""
        return bool(self.scores)

    @property
    def has_classes(self) -> bool:
        """True if values are classes: 1 keeps the limits, 0 breaks one."""
        return self.scores == "passable"

    @property
    def factor(self) -> float:
        """Values in SI units times this are in `unit`."""
        return 1.0 if self.limit is None else (self.limit.shown or self.limit.unit).factor

    def find_limit(self, rover: Rover) -> float | None:
        """Return the limit of the values [unit], None if there is none."""
        bound = None if self.limit is None else self.limit.find_bound(rover)
        return self.factor * bound if isinstance(bound, float | int) else None


def _limited(code: str, scores: str, top: Callable[[Rover], float] | None = None) -> Layer:
    """Return the layer of scores that the limit of a code holds."""
    limit = next(row for row in LIMITS if row.code == code)
    return Layer((limit.shown or limit.unit).name, scores, limit, top)


def _standing_clearance(rover: Rover) -> float:
    """Return the clearance of the belly on flat ground [cm]."""
    ground = rover.suspension.wheels["rear"][2] - rover.wheel.radius
    return max(100.0 * (rover.belly.z - ground), 100.0 * rover.limits.belly_clearance + 1.0)


HEIGHT, SLOPE, FRICTION = "height", "slope", "friction of the ground"
LAYERS: Mapping[str, Layer] = {
    HEIGHT: Layer("m"),
    SLOPE: Layer("deg", top=lambda _rover: STEEP),
    FRICTION: Layer(top=lambda _rover: 1.0),
    "passable or not": Layer(scores="passable", top=lambda _rover: 1.0),
    "friction utilisation": _limited("friction", "friction_utilisation"),
    "torque saturation": _limited("torque", "torque_saturation"),
    "stability margin": _limited(
        "tip_over", "tip_over_ratio", lambda rover: max(1.0, rover.limits.tip_over_ratio + 0.1)
    ),
    "smallest wheel load": _limited("wheel_lift", "least_load", lambda rover: rover.weight / 6.0),
    "tilt": _limited("tilt", "tilt"),
    "belly clearance": _limited("belly", "belly_clearance", _standing_clearance),
}
"""The layers by name."""


def list_layers(terrain: Terrain) -> list[str]:
    """Return the names of the layers of a ground; the friction only where its map has one."""
    return [name for name in LAYERS if name != FRICTION or terrain.friction is not None]


def compute_slope(x: Floats, y: Floats, heights: Floats) -> Floats:
    """Return the slope (ny, nx) [deg] of heights (ny, nx) [m] at x (nx,) and y (ny,) [m]."""
    along_y, along_x = np.gradient(heights, y, x)
    return np.asarray(np.degrees(np.arctan(np.hypot(along_x, along_y))))


def predict_layer(
    layer: Layer,
    rover: Rover,
    terrain: Any,
    heading: float | Floats,
    at: tuple[Floats, Floats],
    options: SweepOptions,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return a predicted layer with the rover at each point.

    Args:
        layer: A layer that is predicted.
        rover: The rover.
        terrain: The ground.
        heading: Yaw of the body [rad]; or a path (n, 3) whose yaw at the nearest waypoint it has.
        at: x (nx,) and y (ny,) of the points [m].
        options: Options of the model.

    Returns:
        Values (ny, nx), NaN where the rover does not settle, and where they break their limit.

    Raises:
        RoverError: The model refuses an option.
    """
    x, y = np.meshgrid(*at)
    poses = np.stack([x, y, _headings(x, y, heading)], axis=-1)
    scores = score_poses(rover, terrain, poses, options)
    code = "" if layer.limit is None else layer.limit.code
    of_layer = [code in ("", row.code) for row in scores.limits.rows]
    broken = (scores.uses[..., of_layer] > 1.0).any(axis=-1)
    settled = scores.status == PoseStatus.SETTLED
    values = layer.factor * np.asarray(getattr(scores, layer.scores), float)
    return np.where(settled, values, np.nan), broken & settled


def _headings(x: Floats, y: Floats, heading: float | Floats) -> Floats:
    """Return the yaw (ny, nx) of the body at places."""
    if isinstance(heading, float):
        return np.full_like(x, heading)
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(heading[:, :2]).query(np.stack([x, y], axis=-1))
    return np.asarray(heading[nearest, 2])


def colour_span(layer: Layer, rover: Rover, values: Floats) -> tuple[float, float]:
    """Return the values of the first and the last colour of a layer with these values."""
    limit = layer.find_limit(rover)
    if layer.top is not None:
        return limit or 0.0, layer.top(rover)
    if limit is not None:
        return 0.0, limit
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
