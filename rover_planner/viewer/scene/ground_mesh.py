# SPDX-License-Identifier: Apache-2.0
"""The terrain as a mesh with a layer as its picture, and where a ray meets the ground."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.glb import TexturedMesh
from rover_planner.viewer.state.colours import BEYOND, ColourScale, map_colours
from rover_planner.viewer.state.layers import (
    FRICTION,
    PREDICTED,
    SLOPE,
    STEEP,
    compute_slope,
    predict_use,
)
from rover_planner.viewer.state.survey_layers import ColouredGround, ShownSurvey

MAX_CELLS = 250
"""Most cells along a side of the mesh; of more, every second, third, ... is drawn."""
MAX_PREDICTED = 100
"""The same for the points at which the model predicts a layer."""
MAX_PIXELS = 1200
"""Most pixels along a side of the texture."""
LIGHT = (-0.6, 0.5, 1.0)
"""Direction to the light of the hillshade."""
RELIEF = 1.3
"""Contrast of the hillshade; 1 is that of a matt surface."""
HATCH_PERIOD, MIN_PERIOD = 0.16, 5
"""Period of the stripes where a limit is broken [m], and the least one [pixels]."""
HATCH_SHADE = 0.5
"""Brightness of the stripes, relative to the ground."""
LINE_SHADE = 0.82
"""Brightness of the grid lines, one every metre, relative to the ground."""


@dataclass(frozen=True, eq=False)
class GroundMesh:
    """The ground as it is drawn."""

    mesh: TexturedMesh
    """The surface with its texture."""
    scale: ColourScale
    """The values of its colours."""


def build_ground_mesh(
    rover: Rover,
    terrain: Terrain,
    layer_name: str,
    heading: float | Floats = 0.0,
    options: SweepOptions = DEFAULT_OPTIONS,
) -> GroundMesh:
    """Return the ground in the colours of a layer, without unknown cells.

    Args:
        rover: The rover, for layers that are predicted.
        terrain: The ground.
        layer_name: One of `list_layers`.
        heading: Yaw of the rover, where layers are predicted [rad]; or a path (n, 3) whose yaw at
            the nearest waypoint it has.
        options: Options of the model for those.

    Raises:
        RoverError: The model refuses an option.
    """
    x, y, heights = subsample(terrain)
    beyond = np.zeros(heights.shape, bool)
    if layer_name in PREDICTED:
        coarse_x, coarse_y, _ = subsample(terrain, MAX_PREDICTED)
        at = (coarse_x, coarse_y)
        used = predict_use(PREDICTED[layer_name], rover, terrain, heading, at, options)
        values, scale = 100.0 * used, ColourScale(0.0, 100.0, "%", 0)
        colours = _resample_nearest(map_colours(values, 0.0, 100.0), at, (x, y))
        beyond = _resample_nearest(used > 1.0, at, (x, y))
        colours[beyond] = BEYOND
    else:
        values, scale = _read_ground(terrain, layer_name, x, y, heights)
        colours = map_colours(values, scale.low, scale.high)
    texture = _texture(_shade_hills(colours, x, y, heights), x, y, beyond)
    return GroundMesh(_build_textured_mesh(x, y, heights, texture), scale)


def _read_ground(
    terrain: Terrain, layer_name: str, x: Floats, y: Floats, heights: Floats
) -> tuple[Floats, ColourScale]:
    """Return the values (ny, nx) of a layer of the ground alone, and their colours."""
    if layer_name == SLOPE:
        return compute_slope(x, y, heights), ColourScale(0.0, STEEP, "deg", 0)
    if layer_name == FRICTION and terrain.friction is not None:
        stride = round((x[1] - x[0]) / terrain.resolution)
        return terrain.friction[::stride, ::stride], ColourScale(0.0, 1.0, "")
    known = heights[np.isfinite(heights)]
    ends = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return heights, ColourScale(*ends, "m")


def build_survey_mesh(
    terrain: Terrain, survey: ShownSurvey, name: str
) -> tuple[TexturedMesh, ColouredGround]:
    """Return the ground in the colours of a survey's layer, and what they mean.

    The texture is finer than the mesh, so that each pixel has the colour of a surveyed cell.
    """
    x, y, heights = subsample(terrain)
    factor = _count_pixels(heights)
    fine_x, fine_y = (
        at[0] + (at[1] - at[0]) * ((np.arange(factor * len(at)) + 0.5) / factor - 0.5)
        for at in (x, y)
    )
    meaning = survey.colour(name, fine_x, fine_y)
    fine = terrain.elevation_at(fine_x, fine_y[:, None])
    texture = _draw_grid_lines(_shade_hills(meaning.colours, fine_x, fine_y, fine), x, y)
    return _build_textured_mesh(x, y, heights, texture), meaning


def subsample(terrain: Terrain, max_cells: int = MAX_CELLS) -> tuple[Floats, Floats, Floats]:
    """Return x (nx,), y (ny,) and heights (ny, nx) [m] of at most `max_cells` cells a side."""
    stride = -(-max(terrain.elevation.shape) // max_cells)
    heights = terrain.elevation[::stride, ::stride]
    ny, nx = heights.shape
    step = stride * terrain.resolution
    x, y = terrain.origin
    return x + step * np.arange(nx), y + step * np.arange(ny), heights


def _resample_nearest(
    values: NDArray[Any], given: tuple[Floats, Floats], wanted: tuple[Floats, Floats]
) -> NDArray[Any]:
    """Return values (ny, nx, ...) at wanted x and y, each that of the nearest given point."""
    columns, rows = (
        np.clip(np.rint((at - was[0]) / (was[1] - was[0])).astype(int), 0, len(was) - 1)
        for at, was in zip(wanted, given, strict=True)
    )
    return values[rows][:, columns]


def _shade_hills(
    colours: NDArray[np.uint8], x: Floats, y: Floats, heights: Floats
) -> NDArray[np.uint8]:
    """Return colours (ny, nx, 3) as if lit from LIGHT.

    Light that is part of the texture costs the page nothing.
    """
    if min(heights.shape) < 2:
        return colours
    along_y, along_x = np.gradient(np.nan_to_num(heights), y, x)
    normal = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    lit = np.clip(normal @ light, 0.0, None) / light[2]
    factor = np.clip(1.0 + RELIEF * (lit - 1.0), 0.3, 1.25)
    return np.clip(colours * factor[..., None], 0, 255).astype(np.uint8)


def _texture(
    colours: NDArray[np.uint8], x: Floats, y: Floats, beyond: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """Return a finer picture of the colours, hatched where asked, with thin lines every metre."""
    factor = _count_pixels(colours)
    fine = ndimage.zoom(colours, (factor, factor, 1), order=1, mode="nearest", grid_mode=True)
    _hatch(fine, np.kron(beyond, np.ones((factor, factor), bool)), (x[1] - x[0]) / factor)
    return _draw_grid_lines(fine, x, y)


def _count_pixels(grid: NDArray) -> int:
    """Return the number of pixels along a side of a cell of a grid (ny, nx, ...)."""
    return max(1, min(8, MAX_PIXELS // max(grid.shape[:2])))


def _draw_grid_lines(fine: NDArray[np.uint8], x: Floats, y: Floats) -> NDArray[np.uint8]:
    """Draw thin lines every metre into a picture that has some pixels for each x and y [m]."""
    for axis, places in enumerate((y, x)):
        step, factor = places[1] - places[0], fine.shape[axis] // len(places)
        pixels = places[0] + step * ((np.arange(fine.shape[axis]) + 0.5) / factor - 0.5)
        lines = np.flatnonzero(np.diff(np.floor(pixels)))
        index = (lines, slice(None)) if axis == 0 else (slice(None), lines)
        fine[index] = (LINE_SHADE * fine[index]).astype(np.uint8)
    return np.asarray(fine, np.uint8)


def _hatch(picture: NDArray[np.uint8], where: NDArray[np.bool_], pixel: float) -> None:
    """Darken diagonal stripes of a picture with a pixel size [m] where asked."""
    period = max(MIN_PERIOD, round(HATCH_PERIOD / pixel))
    row, column = np.ogrid[: where.shape[0], : where.shape[1]]
    stripes = where & ((row + column) % period < 0.4 * period)
    picture[stripes] = (HATCH_SHADE * picture[stripes]).astype(np.uint8)


def _build_textured_mesh(
    x: Floats, y: Floats, heights: Floats, texture: NDArray[np.uint8]
) -> TexturedMesh:
    """Return the surface of heights (ny, nx) [m] at x and y [m] with a picture on it."""
    gx, gy = np.meshgrid(x, y)
    vertices = np.column_stack([gx.ravel(), gy.ravel(), np.nan_to_num(heights).ravel()])
    ny, nx = heights.shape
    u, v = np.meshgrid((np.arange(nx) + 0.5) / nx, (np.arange(ny) + 0.5) / ny)
    uv = np.column_stack([u.ravel(), v.ravel()])
    return TexturedMesh(vertices, join_cells(np.isfinite(heights)), uv, texture)


def join_cells(known: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the triangles (m, 3) between the centres of cells that are known (ny, nx)."""
    index = np.arange(known.size).reshape(known.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, 1:] & known[1:, :-1]
    lower = np.column_stack([a[whole], b[whole], c[whole]])
    return np.concatenate([lower, np.column_stack([a[whole], c[whole], d[whole]])])


def intersect_ground(terrain: Terrain, origin: Floats, direction: Floats) -> Floats | None:
    """Return where a ray first meets known ground, x and y (2,) [m]; None if it does not.

    Args:
        terrain: The ground.
        origin: (3,) start of the ray [m].
        direction: (3,) its direction, of any length.
    """
    direction = direction / np.linalg.norm(direction)
    ny, nx = terrain.elevation.shape
    reach = np.linalg.norm(origin[:2] - np.asarray(terrain.origin))
    heights = np.abs(terrain.elevation[np.isfinite(terrain.elevation)]).max()
    reach += terrain.resolution * np.hypot(nx, ny) + abs(origin[2]) + heights
    along = np.arange(0.0, reach, 0.5 * terrain.resolution)
    points = origin + along[:, None] * direction
    ground = terrain.elevation_at(points[:, 0], points[:, 1])
    below = np.flatnonzero(points[:, 2] <= ground)
    return np.asarray(points[below[0], :2]) if below.size else None
