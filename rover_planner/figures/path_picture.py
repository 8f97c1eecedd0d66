# SPDX-License-Identifier: Apache-2.0
"""Draws the answer to a question for a path: the path, or the closed area, on the shaded map."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patheffects import withStroke

from rover_planner.figures.pictures import (
    INK,
    PASSABLE,
    REFUSED,
    draw_ground,
    drawing,
    find_extent,
)
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import SearchQuery


def draw_path(path: Path, question: SearchQuery, answer: SearchResult) -> None:
    """Draw the map with start and goal, and the path or the area that is closed in.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        question: The question.
        answer: The answer to it.

    Raises:
        PlanningError: The file cannot be written.
    """
    terrain = question.terrain
    elevation = np.asarray(terrain.elevation)
    with drawing(path, (8.5, 7.0)) as figure:
        axes = figure.subplots()
        extent = find_extent(terrain.origin, elevation.shape, terrain.resolution)
        draw_ground(axes, elevation, terrain.resolution, extent)
        if answer.closed is not None:
            _draw_area(axes, answer)
        if answer.path is not None:
            x, y, _ = answer.path.poses.T
            halo = [withStroke(linewidth=4.5, foreground="white")]
            axes.plot(x, y, color=PASSABLE, linewidth=2.2, path_effects=halo, label="way")
        _draw_end(axes, "start", np.asarray(question.start), INK)
        _draw_end(axes, "goal", np.asarray(question.goal), REFUSED)
        axes.set_title(_title(answer), loc="left", wrap=True)
        axes.legend(loc="upper left", frameon=True, framealpha=0.85)


def _draw_area(axes: Axes, answer: SearchResult) -> None:
    assert answer.closed is not None
    nodes = answer.nodes
    left, low = (nodes.cell * first for first in nodes.first)
    axes.imshow(
        np.where(answer.closed.places, 1.0, np.nan),
        origin="lower",
        extent=find_extent((left, low), nodes.shape, nodes.cell),
        cmap=ListedColormap([REFUSED if answer.closed.around_goal else PASSABLE]),
        alpha=0.45,
    )


def _draw_end(axes: Axes, name: str, pose: np.ndarray, colour: str) -> None:
    x, y, yaw = pose
    axes.plot(x, y, "o", color=colour, markersize=8, markeredgecolor="white", label=name)
    axes.annotate(
        "",
        (x + 0.8 * np.cos(yaw), y + 0.8 * np.sin(yaw)),
        (x, y),
        arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.8},
    )


def _title(answer: SearchResult) -> str:
    if answer.path is None:
        return answer.reason
    prediction = answer.path.prediction
    return (
        f"way of {answer.path.length:.1f} m, {float(prediction.energy[-1]):.0f} J, "
        f"{float(prediction.time[-1]) / 60.0:.1f} min; "
        f"{answer.edges_judged} of {answer.edges} edges judged in {answer.seconds:.1f} s"
    )
