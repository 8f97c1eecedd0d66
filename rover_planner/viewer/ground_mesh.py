"""The terrain as a coloured mesh, and where a click on it is."""

from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import NDArray

from rover_physics.map_sweep import score_poses
from rover_physics.rover import Rover
from rover_physics.terrain import Terrain
from rover_planner.viewer.colours import ramp

Floats = NDArray[np.float64]
MOST_CELLS = 250
"""Cells along a side beyond which only every second, third, ... is drawn."""
STEEP = np.radians(35.0)


def thin_out(terrain: Terrain) -> tuple[Floats, Floats, Floats]:
    """Return x (nx,), y (ny,) and heights (ny, nx) [m] of the cells that are drawn."""
    stride = -(-max(terrain.elevation.shape) // MOST_CELLS)
    heights = terrain.elevation[::stride, ::stride]
    ny, nx = heights.shape
    step = stride * terrain.resolution
    return (
        terrain.origin[0] + step * np.arange(nx),
        terrain.origin[1] + step * np.arange(ny),
        heights,
    )


def slope_of(x: Floats, y: Floats, heights: Floats) -> Floats:
    """Return the slope angle at each cell [rad]."""
    along_y, along_x = np.gradient(heights, y, x)
    return np.arctan(np.hypot(along_x, along_y))


def predicted_layer(
    name: str, rover: Rover, terrain: Terrain, heading: float, at: tuple[Floats, Floats]
) -> Floats:
    """Return a field of `PoseScores` (ny, nx) with the rover over each cell at a heading [rad]."""
    x, y = np.meshgrid(*at)
    poses = np.stack([x, y, np.full_like(x, heading)], axis=-1)
    return np.asarray(getattr(score_poses(rover, terrain, poses), name), dtype=float)


LAYERS: dict[str, tuple[str, Callable[[Rover], tuple[float, float]] | None]] = {
    "height": ("", None),
    "slope": ("", lambda rover: (0.0, STEEP)),
    "friction utilisation": ("friction_utilisation", lambda rover: (0.0, 1.0)),
    "torque saturation": ("torque_saturation", lambda rover: (0.0, 1.0)),
    "stability margin": ("tip_over_ratio", lambda rover: (0.0, 1.0)),
    "tilt": ("tilt", lambda rover: (0.0, rover.limits.tilt)),
    "belly clearance": (
        "belly_clearance",
        lambda rover: (0.0, rover.wheel.radius * 2.0),
    ),
}
"""What the ground can be coloured by: field of `PoseScores`, and the range of the colours."""


def ground_mesh(
    rover: Rover, terrain: Terrain, layer: str, heading: float = 0.0
) -> tuple[trimesh.Trimesh, tuple[float, float]]:
    """Return the ground in the colours of a layer, and what their range stands for.

    Args:
        rover: The rover, for layers that are predicted.
        terrain: The ground; unknown cells are left out.
        layer: A name of LAYERS.
        heading: At which layers are predicted [rad].
    """
    x, y, heights = thin_out(terrain)
    field, span = LAYERS[layer]
    if field:
        values = predicted_layer(field, rover, terrain, heading, (x, y))
    else:
        values = heights if layer == "height" else slope_of(x, y, heights)
    known = values[np.isfinite(values)]
    if span is not None:
        low, high = span(rover)
    elif known.size:
        low, high = float(known.min()), float(known.max())
    else:
        low, high = 0.0, 1.0
    return _mesh(x, y, heights, ramp(values, low, high)), (low, high)


def _mesh(x: Floats, y: Floats, heights: Floats, colours: NDArray[np.uint8]) -> trimesh.Trimesh:
    gx, gy = np.meshgrid(x, y)
    vertices = np.column_stack([gx.ravel(), gy.ravel(), np.nan_to_num(heights).ravel()])
    index = np.arange(heights.size).reshape(heights.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    known = np.isfinite(heights)
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, 1:] & known[1:, :-1]
    faces = np.concatenate(
        [
            np.column_stack([a[whole], b[whole], c[whole]]),
            np.column_stack([a[whole], c[whole], d[whole]]),
        ]
    )
    opaque = np.full((heights.size, 1), 255, np.uint8)
    colour = np.hstack([colours.reshape(-1, 3), opaque])
    return trimesh.Trimesh(vertices, faces, vertex_colors=colour, process=False)


def hit_ground(terrain: Terrain, origin: Floats, direction: Floats) -> Floats | None:
    """Return where a ray first meets known ground, x and y (2,) [m]; None if it does not.

    Args:
        terrain: The ground.
        origin: (3,) start of the ray [m].
        direction: (3,) its direction.
    """
    direction = direction / np.linalg.norm(direction)
    ny, nx = terrain.elevation.shape
    reach = np.linalg.norm(origin[:2] - np.asarray(terrain.origin))
    reach += terrain.resolution * np.hypot(nx, ny) + abs(origin[2]) + np.nanmax(terrain.elevation)
    along = np.arange(0.0, reach, 0.5 * terrain.resolution)
    points = origin + along[:, None] * direction
    heights = terrain.elevation_at(points[:, 0], points[:, 1])
    below = np.flatnonzero(points[:, 2] <= heights)
    if not below.size:
        return None
    return points[below[0], :2]
