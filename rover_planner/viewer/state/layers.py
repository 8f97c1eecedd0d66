"""Layers that colour the ground: its shape, and what the model predicts at each cell."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.map_sweep import PoseScores, score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover

STEEP = 35.0
"""Slope of the last colour [deg]."""


@dataclass(frozen=True)
class Layer:
    """One layer: its unit, its values and the range of its colours."""

    unit: str
    """Unit for the scale, empty for none."""
    score: Callable[[Rover, PoseScores], Floats] | None = None
    """Values from scores of the rover at the cells; None for layers of the ground alone."""
    span: Callable[[Rover], tuple[float, float]] | None = None
    """Values of the first and last colour; None: the smallest and largest value."""
    limit: Callable[[Rover], float] | None = None
    """Limit of the values; None for none."""
    is_lowest: bool = False
    """Whether the limit is the smallest good value, not the largest."""
    has_classes: bool = False
    """Whether values are classes: 1 keeps the limits, 0 breaks one."""

    def find_beyond(self, rover: Rover, values: Floats) -> NDArray[np.bool_]:
        """Return where values break the limit; NaN breaks none."""
        if self.has_classes:
            return np.asarray(values == 0.0)
        if self.limit is None:
            return np.zeros(values.shape, bool)
        limit = self.limit(rover)
        return np.asarray(values < limit if self.is_lowest else values > limit)


HEIGHT, SLOPE = "height", "slope"
LAYERS: Mapping[str, Layer] = {
    HEIGHT: Layer("m"),
    SLOPE: Layer("deg", span=lambda _rover: (0.0, STEEP)),
    "passable or not": Layer(
        "",
        lambda rover, scores: np.where(scores.status == 0, scores.within_limits(rover), np.nan),
        lambda _rover: (0.0, 1.0),
        has_classes=True,
    ),
    "friction utilisation": Layer(
        "",
        lambda _rover, scores: np.asarray(scores.friction_utilisation, dtype=float),
        lambda rover: (0.0, rover.limits.friction_utilisation),
        lambda rover: rover.limits.friction_utilisation,
    ),
    "torque saturation": Layer(
        "",
        lambda _rover, scores: np.asarray(scores.torque_saturation, dtype=float),
        lambda rover: (0.0, rover.limits.torque_saturation),
        lambda rover: rover.limits.torque_saturation,
    ),
    "stability margin": Layer(
        "",
        lambda _rover, scores: np.asarray(scores.tip_over_ratio, dtype=float),
        lambda rover: (rover.limits.tip_over_ratio, max(1.0, rover.limits.tip_over_ratio + 0.1)),
        lambda rover: rover.limits.tip_over_ratio,
        is_lowest=True,
    ),
    "smallest wheel load": Layer(
        "N",
        lambda _rover, scores: np.asarray(scores.least_load, dtype=float),
        lambda rover: (0.0, rover.weight / 6.0),
        lambda _rover: 0.0,
        is_lowest=True,
    ),
    "tilt": Layer(
        "deg",
        lambda _rover, scores: np.degrees(scores.tilt),
        lambda rover: (0.0, float(np.degrees(rover.limits.tilt))),
        lambda rover: float(np.degrees(rover.limits.tilt)),
    ),
    "belly clearance": Layer(
        "cm",
        lambda _rover, scores: 100.0 * np.asarray(scores.belly_clearance, dtype=float),
        lambda rover: _belly_span(rover),
        lambda rover: 100.0 * rover.limits.belly_clearance,
        is_lowest=True,
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
) -> Floats:
    """Return the values (ny, nx) of a predicted layer with the rover at each point.

    Args:
        layer: A layer with a score.
        rover: The rover.
        terrain: The ground.
        heading: Yaw of the body [rad]; or a path (n, 3) whose yaw at the nearest waypoint it has.
        at: x (nx,) and y (ny,) of the points [m].
        options: Options of the model.

    Raises:
        RoverError: The model refuses an option.
    """
    assert layer.score is not None
    x, y = np.meshgrid(*at)
    poses = np.stack([x, y, _headings(x, y, heading)], axis=-1)
    return np.asarray(layer.score(rover, score_poses(rover, terrain, poses, options)))


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
