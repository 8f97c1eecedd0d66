# SPDX-License-Identifier: Apache-2.0
"""Layers that colour the ground: its shape, and what the model predicts at each cell."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.limits.table import LIMITS
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.map_sweep import PoseScores, score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus

STEEP = 35.0
"""Slope of the last colour [deg]."""


@dataclass(frozen=True)
class Layer:
    """One layer: its unit, its values and the range of its colours."""

    unit: str
    """Unit for the scale, empty for none."""
    score: Callable[[PoseScores], NDArray[Any]] | None = None
    """Values from scores of the rover at the cells; None for layers of the ground alone."""
    span: Callable[[Rover], tuple[float, float]] | None = None
    """Values of the first and last colour; None: the smallest and largest value."""
    code: str = ""
    """Code of the limit of the values; empty for none."""
    factor: float = 1.0
    """The limit in SI units times this is in `unit`."""
    has_classes: bool = False
    """Whether values are classes: 1 keeps the limits, 0 breaks one."""

    def find_limit(self, rover: Rover) -> float | None:
        """Return the limit of the values, None if there is none."""
        row = next((row for row in LIMITS if row.code == self.code), None)
        bound = None if row is None else row.find_bound(rover)
        return self.factor * bound if isinstance(bound, float | int) else None


HEIGHT, SLOPE = "height", "slope"
LAYERS: Mapping[str, Layer] = {
    HEIGHT: Layer("m"),
    SLOPE: Layer("deg", span=lambda _rover: (0.0, STEEP)),
    "passable or not": Layer(
        "",
        lambda scores: np.where(scores.status == 0, scores.passable, np.nan),
        lambda _rover: (0.0, 1.0),
        has_classes=True,
    ),
    "friction utilisation": Layer(
        "",
        lambda scores: scores.friction_utilisation,
        lambda rover: (0.0, rover.limits.friction_utilisation),
        "friction",
    ),
    "torque saturation": Layer(
        "",
        lambda scores: scores.torque_saturation,
        lambda rover: (0.0, rover.limits.torque_saturation),
        "torque",
    ),
    "stability margin": Layer(
        "",
        lambda scores: scores.tip_over_ratio,
        lambda rover: (rover.limits.tip_over_ratio, max(1.0, rover.limits.tip_over_ratio + 0.1)),
        "tip_over",
    ),
    "smallest wheel load": Layer(
        "N",
        lambda scores: scores.least_load,
        lambda rover: (0.0, rover.weight / 6.0),
        "wheel_lift",
    ),
    "tilt": Layer(
        "deg",
        lambda scores: np.degrees(scores.tilt),
        lambda rover: (0.0, float(np.degrees(rover.limits.tilt))),
        "tilt",
        180.0 / np.pi,
    ),
    "belly clearance": Layer(
        "cm",
        lambda scores: 100.0 * scores.belly_clearance.astype(float),
        lambda rover: _belly_span(rover),
        "belly",
        100.0,
    ),
}
"""The layers by name."""


def _belly_span(rover: Rover) -> tuple[float, float]:
    """Return the smallest good clearance, and that on flat ground [cm]."""
    least = 100.0 * rover.limits.belly_clearance
    return least, max(100.0 * (rover.belly.z - _flat_ground(rover)), least + 1.0)


def _flat_ground(rover: Rover) -> float:
    """Return the height of flat ground under the wheels, body frame [m]."""
    return rover.suspension.wheels["rear"][2] - rover.wheel.radius


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
        layer: A layer with a score.
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
    assert layer.score is not None
    x, y = np.meshgrid(*at)
    poses = np.stack([x, y, _headings(x, y, heading)], axis=-1)
    scores = score_poses(rover, terrain, poses, options)
    of_layer = [layer.has_classes or row.code == layer.code for row in scores.limits.rows]
    broken = (scores.uses[..., of_layer] > 1.0).any(axis=-1)
    return np.asarray(layer.score(scores), float), broken & (scores.status == PoseStatus.SETTLED)


def _headings(x: Floats, y: Floats, heading: float | Floats) -> Floats:
    """Return the yaw (ny, nx) of the body at places."""
    if isinstance(heading, float):
        return np.full_like(x, heading)
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(heading[:, :2]).query(np.stack([x, y], axis=-1))
    return np.asarray(heading[nearest, 2])


def colour_span(layer: Layer, rover: Rover, values: Floats) -> tuple[float, float]:
    """Return the values of the first and the last colour of a layer with these values."""
    known = values[np.isfinite(values)]
    if layer.span is not None:
        return layer.span(rover)
    return (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
