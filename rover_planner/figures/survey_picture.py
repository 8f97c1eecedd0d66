# SPDX-License-Identifier: Apache-2.0
"""Draws a survey: classes, or what can be reached, on the shaded map with legend and scale bar."""

import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.patches import Patch, Rectangle

from rover_planner.figures.pictures import (
    INK,
    LEVEL,
    UNKNOWN,
    Extent,
    draw_ground,
    drawing,
    find_extent,
)
from rover_planner.survey.layers import (
    CLASS_COLOURS,
    CLASS_LABELS,
    NOT_SURVEYED,
    SOME_HEADINGS,
    UNKNOWN_LABEL,
    count_skipped,
    read_drawn_classes,
)
from rover_planner.survey.reachable import ReachableArea
from rover_planner.survey.store import SurveyStore

_STRENGTH = 0.55


def draw_survey(path: Path, store: SurveyStore) -> None:
    """Draw the worst class of each cell over the headings, and where the heading decides.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        store: The survey.

    Raises:
        PlanningError: The file cannot be written, or the map cannot be read any more.
    """
    classes = read_drawn_classes(store)
    shown = np.where(classes == NOT_SURVEYED, np.nan, classes)
    labels = [*zip(CLASS_LABELS, CLASS_COLOURS, strict=True), (UNKNOWN_LABEL, UNKNOWN)]
    rover = store.notes.description["rover"]["name"]
    title = f"{rover}: worst class over {store.notes.headings} headings"
    colours = ListedColormap(CLASS_COLOURS).with_extremes(bad=UNKNOWN)
    _draw(path, store, shown, (colours, 0.0, SOME_HEADINGS), labels, title)


def draw_reachable(path: Path, store: SurveyStore, area: ReachableArea) -> None:
    """Draw the cells that can be reached and returned from, coloured by the length of the path.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        store: The survey.
        area: What can be reached.

    Raises:
        PlanningError: As `draw_survey`.
    """
    every = count_skipped(store.notes.layout.shape)
    distance = area.distance[::every, ::every]
    shown = np.where(np.isfinite(distance), distance, np.nan)
    longest = area.longest or 0.0
    (left, low), cell = store.notes.frame.origin, store.notes.cell
    size = area.cells * cell**2
    title = f"reached and returned from: {size:.1f} m2, longest path {longest:.1f} m"
    colours = matplotlib.colormaps["viridis"]
    shares = (0.0, 0.5, 1.0) if longest > 0.0 else ()
    labels = [(f"path of {share * longest:.1f} m", colours(share)) for share in shares]
    start = left + area.start[1] * cell, low + area.start[0] * cell
    _draw(path, store, shown, (colours, 0.0, max(longest, 1e-9)), labels, title, start)


def _draw(path, store, shown, scale, labels, title, start=None) -> None:
    """Draw values (rows, columns) over the map.

    Args:
        path: The picture.
        store: The survey.
        shown: Values, NaN where there is none.
        scale: Colour map, with the colour of NaN if that is to be drawn, and the values at its
            ends.
        labels: Text and colour of each entry of the legend.
        title: Title.
        start: x, y of the start [m] (default: none).
    """
    colours, least, most = scale
    notes = store.notes
    frame, (rows, columns) = notes.frame, notes.layout.map_shape
    extent = find_extent(frame.origin, (rows, columns), frame.resolution)
    every = count_skipped((rows, columns))
    heights = store.open_map().read((slice(0, rows), slice(0, columns)), every)["elevation"]
    cell = notes.cell * count_skipped(notes.layout.shape)
    with drawing(path, (8.5, 7.5)) as figure:
        axes = figure.subplots()
        draw_ground(axes, heights, frame.resolution * every, extent)
        axes.imshow(shown, origin="lower", extent=find_extent(frame.origin, shown.shape, cell),
                    cmap=colours, vmin=least, vmax=most, alpha=_STRENGTH,
                    interpolation="nearest")  # fmt: skip
        if start is not None:
            axes.plot(*start, "o", color=INK, markersize=7, markeredgecolor="white")
        axes.set(xlim=extent[:2], ylim=extent[2:])
        axes.set_title(title, loc="left")
        handles = [Patch(color=on_level_ground(colour), label=text) for text, colour in labels]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)  # hides no ground
        _draw_scale_bar(axes, extent)


def on_level_ground(colour) -> tuple[float, float, float]:
    """Return a colour of a layer as it is on level ground; unknown ground has its own.

    The layer lies over the shaded ground, so that a legend of pure colours would not match it.
    """
    if colour == UNKNOWN:
        return to_rgb(UNKNOWN)
    red, green, blue = (_STRENGTH * c + (1.0 - _STRENGTH) * LEVEL for c in to_rgb(colour))
    return red, green, blue


def _draw_scale_bar(axes: Axes, extent: Extent) -> None:
    """Draw a bar of a round length, about a fifth of the map's width."""
    width, height = extent[1] - extent[0], extent[3] - extent[2]
    length = choose_bar(width)
    x, y = extent[1] - 0.05 * width - length, extent[2] + 0.04 * height
    axes.add_patch(Rectangle((x, y), length, 0.012 * height, color=INK))
    plate = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
    middle, above = x + 0.5 * length, y + 0.02 * height
    axes.text(middle, above, f"{length:g} m", ha="center", color=INK, bbox=plate)


def choose_bar(width: float) -> float:
    """Return the round length of a bar: at most a quarter of a width, up to rounding, all in m."""
    most = 0.25 * width * (1.0 + 1e-9)
    power = 10.0 ** math.floor(math.log10(most))
    return power * max(k for k in (1, 2, 5) if k * power <= most)
