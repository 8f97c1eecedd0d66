# SPDX-License-Identifier: Apache-2.0
"""The terrain as a mesh with a picture on it, and where a ray meets the ground."""

import gc
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.hill_shade import LEVEL_SHADE, hill_shade
from rover_planner.planning.search.query import Site
from rover_planner.viewer.scene.canvas import find_origin
from rover_planner.viewer.state import layers
from rover_planner.viewer.state.background_work import WorkStep

SHADES = (0.3, 1.25)
"""Least and largest brightness of the ground; 1 where it is level."""
HATCH_PERIOD, MIN_PERIOD = 0.16, 5
"""Period of the stripes where a limit is broken [m], and the least one [pixels]."""
HATCH_SHADE = 0.5
"""Brightness of the stripes, relative to the ground."""
LINE_SHADE = 0.82
"""Brightness of the grid lines, one every metre, relative to the ground."""
UNLIT = "KHR_materials_unlit"
"""Extension of glTF for what needs no light. Without a graphics card, a matt surface that fills
the screen takes most of the time of a picture."""


def paint(
    site: Site,
    how: layers.Colouring,
    path: Floats | None = None,
    survey: layers.ShownSurvey | None = None,
) -> Iterator[WorkStep | tuple[bytes, Mapping[str, Any]]]:
    """Yield what is begun, and the painted ground as a file for the scene, with its legend.

    A layer that is predicted for the rover takes seconds; it may be for the heading of a path of
    poses (n, 3).
    """
    yield WorkStep("ground")
    name, ground = how.layer, layers.thin(site.terrain)
    if survey is not None and name in survey.names:
        places = layers.spread(ground, layers.count_pixels(ground))
        coloured = survey.colour(name, site.rover, site.options.model, places)
    elif name in layers.PREDICTED:
        coloured = layers.colour_limit(site, how, ground, path)
    else:
        coloured = layers.colour_ground(name, ground)
    yield write_ground(ground, coloured, find_origin(site.terrain)), coloured.legend


def draw_picture(ground: Terrain, coloured: layers.ColouredGround) -> NDArray[np.uint8]:
    """Return the picture (my, mx, 3) on a ground.

    It is lit, as light in a picture costs the page nothing, hatched where a limit is broken, and
    has thin lines every metre.
    """
    size = layers.count_pixels(ground)
    x, y = layers.spread(ground, size)
    light = hill_shade(ground.elevation, ground.resolution) / LEVEL_SHADE
    light = np.clip(np.nan_to_num(light, nan=1.0), *SHADES).astype(np.float32)
    factor = layers.refine(light, size)  # a whole picture of them: half the memory
    if coloured.beyond is not None:
        period = max(MIN_PERIOD, round(HATCH_PERIOD / (x[1] - x[0])))
        row, column = (np.arange(len(at), dtype=np.int16) for at in (y, x))
        stripes = (row[:, None] + column) % period < 0.4 * period
        np.multiply(factor, HATCH_SHADE, out=factor, where=coloured.beyond & stripes)
    factor[np.flatnonzero(np.diff(np.floor(y)))] *= LINE_SHADE
    factor[:, np.flatnonzero(np.diff(np.floor(x)))] *= LINE_SHADE
    picture = np.empty_like(coloured.colours)
    for k in range(3):  # one by one: all at once take three times the memory
        picture[..., k] = np.minimum(coloured.colours[..., k] * factor, 255.0)
    return picture


def write_ground(ground: Terrain, coloured: layers.ColouredGround, origin: Floats) -> bytes:
    """Return the known cells of a ground about an origin (3,) [m] as a binary glTF file.

    It has the picture on it, without lights. It takes a third of a second: most of it to compress
    the picture.
    """
    from PIL import Image

    heights, (ny, nx) = ground.elevation, ground.elevation.shape
    x, y = np.meshgrid(*layers.spread(ground, (ny, nx)))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.nan_to_num(heights).ravel()]) - origin
    u, v = np.meshgrid((np.arange(nx) + 0.5) / nx, (np.arange(ny) + 0.5) / ny)
    picture = Image.fromarray(draw_picture(ground, coloured))
    visual = trimesh.visual.TextureVisuals(
        np.column_stack([u.ravel(), 1.0 - v.ravel()]),
        trimesh.visual.material.PBRMaterial(baseColorTexture=picture),
    )
    faces = _join_cells(np.isfinite(heights))
    mesh = trimesh.Trimesh(vertices, faces, visual=visual, process=False)
    file: Any = mesh.export(file_type="glb", tree_postprocessor=_leave_unlit)
    del mesh, visual, picture
    gc.collect()  # meshes of trimesh hold themselves: a page would keep dozens of old grounds
    return bytes(file)


def _leave_unlit(tree: dict) -> None:
    tree["extensionsUsed"] = [UNLIT]
    for material in tree["materials"]:
        material["extensions"] = {UNLIT: {}}


def _join_cells(known: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the triangles (m, 3) between the centres of cells that are known (ny, nx)."""
    index = np.arange(known.size).reshape(known.shape)
    cells = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    cells = cells[known.ravel()[cells].all(axis=-1)]
    return np.concatenate([cells[:, :3], cells[:, [0, 2, 3]]])


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
