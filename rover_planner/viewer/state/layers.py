# SPDX-License-Identifier: Apache-2.0
"""Layers that colour the ground: its shape, its friction, uses of the rover's limits, a survey."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import ndimage

from rover_physics.files.validation import show_file
from rover_physics.limits.table import LIMITS
from rover_physics.names import OPTIMAL
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.plain_values import to_plain
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.record import QUANTITIES
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.planning.search.query import Site
from rover_planner.shell.extras import need
from rover_planner.survey.layers import (
    CLASS_COLOURS,
    CLASS_LABELS,
    UNKNOWN_LABEL,
    count_skipped,
    number_limits,
    read_drawn_classes,
)
from rover_planner.survey.store import SurveyStore
from rover_planner.viewer.state.colours import REFUSED, UNKNOWN, map_colours, to_css

MAX_CELLS = 250
"""Most cells along a side of the mesh; of more, every second, third, ... is drawn."""
MAX_PIXELS, MOST_IN_CELL = 1200, 8
"""Most pixels along a side of the picture, and of a cell of the mesh."""
STEEP = 35.0
"""Slope of the last colour [deg]."""
MAX_PREDICTED = 100
"""Most points along a side of the ground at which the model predicts a layer."""
STOPS = np.linspace(0.0, 1.0, 9)
"""Places of the colours from which a gradient is made."""
HEIGHT, SLOPE, FRICTION = "height", "slope", "friction of the ground"
"""Layers of the ground alone."""
_OF_PATHS = [one.name for one in QUANTITIES if one.of_path]
PREDICTED: Mapping[str, str] = {"use of all limits": ""} | {
    f"use of {row.title}": row.code for row in LIMITS[::-1] if row.reads not in _OF_PATHS
}
"""Layers that the model predicts for the rover: the code of the limit, empty for all of them."""
CLASS, LIMIT = "survey: class", "survey: first limit"
"""Layers of a survey."""
OPTION_NAMES = {"policy": "torque policy", "max_torque": "largest torque"}
"""Names of options in words, where they are not those of the fields."""


def thin(terrain: Terrain) -> Terrain:
    """Return a ground with at most MAX_CELLS cells a side, as its mesh has them."""
    stride = -(-max(terrain.elevation.shape) // MAX_CELLS)
    friction = None if terrain.friction is None else terrain.friction[::stride, ::stride]
    heights = terrain.elevation[::stride, ::stride]
    return Terrain(heights, stride * terrain.resolution, terrain.origin, friction)


def count_pixels(ground: Terrain) -> tuple[int, int]:
    """Return rows and columns of the picture on a ground, the same number for each cell."""
    ny, nx = ground.elevation.shape
    factor = max(1, min(MOST_IN_CELL, MAX_PIXELS // max(ny, nx)))
    return factor * ny, factor * nx


def spread(ground: Terrain, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Return x (nx,) and y (ny,) [m] of the middles of equal parts (ny, nx) of all cells."""
    (left, right, low, high), half = ground.bounds, 0.5 * ground.resolution
    y, x = (2 * count + 1 for count in size)
    return (
        np.linspace(left - half, right + half, x)[1::2],
        np.linspace(low - half, high + half, y)[1::2],
    )


def refine(values: NDArray[Any], size: tuple[int, int], order: int = 1) -> NDArray[Any]:
    """Return values (ky, kx, ...) of equal parts of all cells as those of (ny, nx) parts.

    They are linear between the parts, or with order 0 those of the nearest one.
    """
    factors = np.divide((*size, *values.shape[2:]), values.shape)
    return np.asarray(ndimage.zoom(values, factors, order=order, mode="nearest", grid_mode=True))


@dataclass(frozen=True)
class Colouring:
    """A layer by which the ground is coloured."""

    layer: str = HEIGHT
    """Name of the layer."""
    heading: Annotated[float, Field(ge=-180.0, le=180.0)] = 0.0
    """Heading of the rover for predicted layers [deg], as a link may have it."""
    along: bool = False
    """True if they are for the heading of the path instead."""


@dataclass(frozen=True, eq=False)
class ColouredGround:
    """The colours of a layer, and what they mean."""

    colours: NDArray[np.uint8]
    """(ny, nx, 3), grey where nothing is known."""
    legend: Mapping[str, Any]
    """Their meaning: its `title`, `keys` (colours as CSS writes them, or "hatched", with what
    they mean), the colours of a `gradient` with the values at both `ends`, and `notes`."""
    beyond: NDArray[np.bool_] | None = None
    """(ny, nx) True where a limit is broken; None without one."""


def list_layers(terrain: Terrain) -> list[str]:
    """Return the names of the layers of a ground; the friction only where its map has one."""
    friction = [] if terrain.friction is None else [FRICTION]
    return [HEIGHT, SLOPE, *friction, *PREDICTED]


def colour_ground(layer: str, ground: Terrain) -> ColouredGround:
    """Return the colours of a layer of the ground alone, which is thinned."""
    values = heights = ground.elevation
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    ends: tuple[str, ...] = f"{low:.2f} m", f"{high:.2f} m"
    if layer == SLOPE:
        values = np.degrees(np.arctan(np.hypot(*np.gradient(heights, ground.resolution))))
        low, high, ends = 0.0, STEEP, ("0 deg", f"{STEEP:.0f} deg")
    elif layer == FRICTION and ground.friction is not None:
        values, low, high, ends = ground.friction, 0.0, 1.0, ("0.00", "1.00")
    colours = refine(map_colours(values, low, high), count_pixels(ground))
    return ColouredGround(colours, _grade(layer, ends))


def colour_limit(
    site: Site, how: Colouring, ground: Terrain, path: Floats | None = None
) -> ColouredGround:
    """Return the colours of the use of a limit with the rover at each place of a thinned ground.

    The model is asked at MAX_PREDICTED places along a side; all others are as the nearest.

    Raises:
        RoverError: The model refuses an option.
    """
    size = count_pixels(ground)
    rows, columns = (min(count, MAX_PREDICTED) for count in size)
    used = predict_use(site, how, spread(ground, (rows, columns)), path)
    colours = map_colours(used, 0.0, 1.0)
    colours[used > 1.0] = REFUSED
    words = "along the path" if how.along else f"at heading {how.heading:g} deg"
    hatched = ("hatched", "beyond the limit")
    return ColouredGround(
        refine(colours, size, 0),
        _grade(f"{how.layer} {words}", ("0 %", "100 %"), hatched),
        refine(used > 1.0, size, 0),
    )


def _grade(title: str, ends: tuple[str, ...], *keys: tuple[str, str]) -> dict[str, Any]:
    """Return the legend of values from one end to the other."""
    gradient = [to_css((r, g, b)) for r, g, b in map_colours(STOPS, 0.0, 1.0).tolist()]
    keys = *keys, (to_css(UNKNOWN), "unknown, or the rover cannot stand")
    return {"title": title, "keys": keys, "gradient": gradient, "ends": ends, "notes": []}


def predict_use(
    site: Site, how: Colouring, at: Sequence[Floats], path: Floats | None = None
) -> Floats:
    """Return the use of the limit of a layer with the rover at each point.

    Args:
        site: Rover and ground, with the options of the model.
        how: Layer and heading.
        at: x (nx,) and y (ny,) of the points [m].
        path: (n, 3) poses whose yaw the rover has if the layer is for the heading of a path.

    Returns:
        Uses (ny, nx), NaN where the rover does not settle or the limit is not asked.

    Raises:
        RoverError: The model refuses an option.
    """
    from scipy.spatial import cKDTree

    x, y = np.meshgrid(*at)
    yaw, code = np.full_like(x, np.radians(how.heading)), PREDICTED[how.layer]
    if how.along and path is not None:  # as at the nearest waypoint
        _, nearest = cKDTree(path[:, :2]).query(np.stack([x, y], axis=-1))
        yaw = path[nearest, 2]
    poses = np.stack([x, y, yaw], axis=-1)
    scores = score_poses(site.rover, site.terrain, poses, site.options.model)
    of_limit = [code in ("", row.code) for row in scores.limits.rows]
    used = np.fmax.reduce(scores.uses[..., of_limit], axis=-1, initial=np.nan)
    return np.where(scores.status == PoseStatus.SETTLED, used, np.nan)


class ShownSurvey:
    """The layers of a survey on the page."""

    names = (CLASS, LIMIT)
    """Names of the layers to choose from."""

    def __init__(self, path: Path, rover: Rover, terrain: Terrain | None):
        """Open a survey to show it with a rover on a map.

        Args:
            path: Folder of the store.
            rover: The rover that is shown.
            terrain: The map that is shown; None if it is the survey's own.

        Raises:
            PlanningError: It is no survey, or one of another rover or map.
        """
        self._store = SurveyStore(path)
        self._every = count_skipped(self._store.notes.layout.shape)
        recorded = self._store.notes.description
        if recorded["rover"] != to_plain(asdict(rover)):
            other = recorded["rover"]["name"]
            what = "another " + rover.name if other == rover.name else f"{other}, not {rover.name}"
            raise PlanningError(
                f"{show_file(path)} is a survey of {what}; name the rover that was surveyed"
            )
        if terrain is not None and recorded["map"] != terrain.fingerprint:
            raise PlanningError(
                f"{show_file(path)} is a survey of another map, or of one with other gaps; give "
                "the map and the --max-gap that were surveyed (default 0), or leave TERRAIN out"
            )

    def colour(
        self, name: str, rover: Rover, options: SweepOptions, places: tuple[Floats, Floats]
    ) -> ColouredGround:
        """Return the colours of a layer, and in what it differs from the page's rover and options.

        Each of the places x (mx,) and y (my,) [m] has the colour of the nearest surveyed cell
        that is read.
        """
        from matplotlib import colormaps
        from matplotlib.colors import ListedColormap, to_hex

        if name == CLASS:
            numbers = read_drawn_classes(self._store)
            palette, labels = [*CLASS_COLOURS], [*CLASS_LABELS]
        else:
            numbers = np.asarray(self._store.layer("first_limit")[:: self._every, :: self._every])
            labels = [c.replace("_", " ") or "none: all headings pass" for c in number_limits()]
            cycle = np.arange(len(labels) - 1) % colormaps["tab20"].N
            palette = [CLASS_COLOURS[0], *colormaps["tab20"](cycle)]
        colours = ListedColormap([*palette, to_css(UNKNOWN)])
        numbers = np.minimum(numbers, len(labels))
        named = [*enumerate(labels), (len(labels), UNKNOWN_LABEL)]
        keys = [(to_hex(colours(k)), label) for k, label in named if (numbers == k).any()]
        notes, (x, y), (ny, nx) = self._store.notes, places, numbers.shape
        asked = notes.description["options"]
        margin = f", control margin {asked['control_margin']:g}" if name == CLASS else ""
        about = f"{notes.headings} headings, a cell every {notes.cell:g} m{margin}"
        told = [f"{notes.description['rover']['name']}, {about}"]
        if differences := self.find_differences(rover, options):
            told.append(f"not as on the page: {'; '.join(differences)}")
        legend = {"title": name, "keys": keys, "gradient": [], "ends": [], "notes": told}
        cell, (left, low) = notes.cell * self._every, notes.frame.origin
        columns = np.rint((x - left) / cell).astype(int).clip(0, nx - 1)
        rows = np.rint((y - low) / cell).astype(int).clip(0, ny - 1)
        nearest = numbers[np.ix_(rows, columns)]
        return ColouredGround(colours(nearest, bytes=True)[..., :3], legend)

    def find_differences(self, rover: Rover, options: SweepOptions) -> tuple[str, ...]:
        """Return in what the survey differs from a rover and options that are shown."""
        recorded = self._store.notes.description
        found = []
        if recorded["rover"] != to_plain(asdict(rover)):
            found.append("the rover was changed since")
        shown = to_plain(asdict(options))
        policies = recorded["options"]["policy"], options.policy
        for key, value in recorded["options"].items():
            other = shown.get(key)
            if key == "control_margin" and OPTIMAL not in policies:
                continue
            if (value or None) != (other or None):  # no joint angles are () or None
                name = OPTION_NAMES.get(key, key.replace("_", " "))
                found.append(
                    f"{name} {_write_value(value)} in the survey, {_write_value(other)} here"
                )
        return tuple(found)


def load_map(path: Path, max_cells: int) -> Terrain:
    """Return the map of a survey.

    Args:
        path: Folder of the store.
        max_cells: Largest number of cells.

    Raises:
        PlanningError: It is no survey, its map is larger, or has changed since.
    """
    store = SurveyStore(path)
    notes = store.notes
    if notes.map_file:
        need("rasterio", "a GeoTIFF")
    source, (rows, columns) = store.open_map(), notes.layout.map_shape
    if rows * columns > max_cells:
        raise PlanningError(
            f"the map of {show_file(path)} has {rows} x {columns} cells; --max-cells is "
            f"{max_cells}"
        )
    store.check_map()
    grids: Any = source.read((slice(0, rows), slice(0, columns)))
    frame = notes.frame
    return Terrain(
        **grids, resolution=frame.resolution, origin=frame.origin, soil_names=source.soil_names
    )


def _write_value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    return "as default" if value is None else f"{value!s:.40}"
