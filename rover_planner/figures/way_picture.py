# SPDX-License-Identifier: Apache-2.0
"""Draws the answer to a question for a way: the way, or the closed area, on the shaded map."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from rover_planner.figures.pictures import STYLE, save_figure
from rover_planner.figures.plots import PASSABLE, REFUSED, hill_shade
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import SearchQuery

_INK = "#222222"


def draw_way(path: Path, question: SearchQuery, answer: SearchResult) -> None:
    """Draw the map with start and goal, and the way or the area that is closed in.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        question: The question.
        answer: The answer to it.

    Raises:
        PlanningError: The file cannot be written.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.5, 7.0), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        _draw_ground(axes, question)
        if answer.closed is not None:
            _draw_area(axes, answer)
        if answer.path is not None:
            x, y, _ = answer.path.poses.T
            halo = [withStroke(linewidth=4.5, foreground="white")]
            axes.plot(x, y, color=PASSABLE, linewidth=2.2, path_effects=halo, label="way")
        for name, pose, colour in (
            ("start", question.start, _INK),
            ("goal", question.goal, REFUSED),
        ):
            _draw_end(axes, name, np.asarray(pose), colour)
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        axes.set_title(_title(answer), loc="left", wrap=True)
        axes.legend(loc="upper left", frameon=True, framealpha=0.85)
        save_figure(path, figure)


def _draw_ground(axes: Axes, question: SearchQuery) -> None:
    terrain = question.terrain
    xmin, xmax, ymin, ymax = terrain.bounds
    half = 0.5 * terrain.resolution
    axes.grid(False)
    axes.set_facecolor("#CCD6E6")
    axes.imshow(
        hill_shade(np.asarray(terrain.elevation), terrain.resolution),
        origin="lower",
        extent=(xmin - half, xmax + half, ymin - half, ymax + half),
        cmap="gray",
        vmin=0.0,
        vmax=1.1,
    )


def _draw_area(axes: Axes, answer: SearchResult) -> None:
    assert answer.closed is not None
    nodes = answer.nodes
    x, y = (nodes.cell * (first - 0.5) for first in nodes.first)
    rows, columns = nodes.shape
    axes.imshow(
        np.where(answer.closed.places, 1.0, np.nan),
        origin="lower",
        extent=(x, x + columns * nodes.cell, y, y + rows * nodes.cell),
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
