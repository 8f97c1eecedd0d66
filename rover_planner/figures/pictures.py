# SPDX-License-Identifier: Apache-2.0
"""The common parts of all pictures: style, writing to a file, and the shaded ground of a map."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of, show_file
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.maps.hill_shade import LEVEL_SHADE, hill_shade

SUFFIXES = (".png", ".svg", ".pdf")
"""Suffixes of pictures."""
STYLE: dict[str, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.labelsize": 9.5,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
}
"""Settings of matplotlib (rcParams)."""
# The palette of Okabe and Ito, which is safe for colour-blind readers.
PASSABLE, REFUSED = "#0072B2", "#D55E00"
WHEEL_COLOURS = {"rear": "#0072b2", "middle": "#e69f00", "front": "#cc79a7"}
"""Colours of rear, middle and front wheels."""
INK, UNKNOWN = "#222222", "#CCD6E6"
"""Colours of lines and texts, and of unknown ground."""
BRIGHTEST = 1.1
"""Brightness that would be white."""
LEVEL = LEVEL_SHADE / BRIGHTEST
"""Grey of level ground in a picture, 0 to 1."""

Extent = tuple[float, float, float, float]
"""Left, right, lower and upper edge [m]."""


def check_picture(path: Path) -> None:
    """Check that a picture has a format and a folder, before long work.

    Raises:
        PlanningError: It has not.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise PlanningError(f"picture {show_file(path)} must be a {', '.join(SUFFIXES)} file")
    if not path.parent.is_dir():
        raise PlanningError(
            f"{show_file(path)}: cannot be written: there is no folder {show_file(path.parent)}"
        )


@contextmanager
def drawing(path: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """Yield a figure to draw in; write it to a file at the end.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        size: Width and height [inch].

    Raises:
        PlanningError: The suffix names no format, or the file cannot be written.
    """
    check_picture(path)
    with matplotlib.rc_context(STYLE):
        figure, picture = Figure(figsize=size, layout="constrained"), io.BytesIO()
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(picture, dpi=130, format=path.suffix[1:].lower())
    with errors_of(path, PlanningError):
        write_file(path, picture.getvalue())


def outlined(width: float, colour: str = "white") -> dict[str, Any]:
    """Return the style of a line with another colour around it, up to a width [pt]."""
    return {"path_effects": [withStroke(linewidth=width, foreground=colour)]}


def find_extent(origin: tuple[float, float], shape: tuple[int, ...], resolution: float) -> Extent:
    """Return the edges of cells (rows, columns), the first of which has its centre at `origin`."""
    x, y = (start - 0.5 * resolution for start in origin)
    return x, x + shape[1] * resolution, y, y + shape[0] * resolution


def draw_ground(
    axes: Axes, elevation: NDArray[np.float64], resolution: float, extent: Extent
) -> None:
    """Prepare axes for a map and draw the shaded ground (ny, nx) [m]; unknown cells are bluish."""
    axes.grid(False)
    axes.set_facecolor(UNKNOWN)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    if min(elevation.shape) >= 2:
        shade = hill_shade(elevation, resolution)
        axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=BRIGHTEST)


def draw_terrain(axes: Axes, terrain: Terrain) -> Extent:
    """Prepare axes for a terrain, draw its shaded ground, and return its edges."""
    extent = find_extent(terrain.origin, terrain.elevation.shape, terrain.resolution)
    draw_ground(axes, np.asarray(terrain.elevation), terrain.resolution, extent)
    return extent


def zoom(axes: Axes, places: NDArray[np.float64], margin: float) -> None:
    """Show the ground around places (n, 2) up to a margin [m]."""
    low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
