# SPDX-License-Identifier: Apache-2.0
"""Draws the answer to a question for a path: on the shaded map, and the use of limits along it."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_planner.figures.pictures import (
    INK,
    PASSABLE,
    REFUSED,
    draw_terrain,
    drawing,
    find_extent,
    outlined,
)
from rover_planner.planning.asked_poses import merge_poses
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import SearchQuery

COLOURS, FAINT = ("#0072B2", "#009E73", "#CC79A7", "#E69F00"), "#BBBBBB"
"""Colours of the most used limits, and of the others."""


def draw_path(path: Path, question: SearchQuery, answer: SearchResult, map_name: str) -> None:
    """Draw the map with start and goal, and the path or the area that is closed in.

    Below a path is the use of each limit along it.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        question: The question.
        answer: The answer to it.
        map_name: Name of the map.

    Raises:
        PlanningError: The file cannot be written.
    """
    terrain = question.site.terrain
    with drawing(path, (8.5, 7.0 if answer.path is None else 9.5)) as figure:
        if answer.path is None:
            axes = figure.subplots()
        else:
            axes, below = figure.subplots(2, height_ratios=(2.4, 1.0))
            _draw_uses(below, question.site.rover, answer.path)
        draw_terrain(axes, terrain)
        if answer.closed is not None:
            _draw_area(axes, answer)
        if answer.path is not None:
            x, y, _ = answer.path.poses.T
            axes.plot(x, y, color=PASSABLE, linewidth=2.2, label="path", **outlined(4.5))
        _draw_end(axes, "start", np.asarray(question.start), INK)
        _draw_end(axes, "goal", np.asarray(question.goal), REFUSED)
        title = f"{question.site.rover.name} on {map_name}: {_title(answer)}"
        axes.set_title(title, loc="left", wrap=True)
        axes.legend(loc="upper left", frameon=True, framealpha=0.85)


def _draw_uses(axes: Axes, rover: Rover, path: Candidate) -> None:
    """Draw the use of each limit over the distance, the most used ones first in the legend."""
    rows = merge_poses(path.prediction)
    limits = limits_of(rover, path.prediction.policy)
    uses = find_uses(limits, rows.prediction.results).use
    titles = list(dict.fromkeys(row.title for row in limits.rows))
    of_title = {
        title: np.fmax.reduce(
            uses[:, [k for k, row in enumerate(limits.rows) if row.title == title]], axis=1
        )
        for title in titles
    }
    ranked = sorted(titles, key=lambda title: -np.nanmax(of_title[title], initial=0.0))
    for k, title in enumerate(ranked):
        shown = k < len(COLOURS)
        colour, width = (COLOURS[k], 1.4) if shown else (FAINT, 0.8)
        label = title if shown else None
        axes.plot(rows.distance, of_title[title], color=colour, lw=width, label=label)
    axes.axhline(1.0, color=REFUSED, linestyle=":", linewidth=1.2)
    axes.set(xlabel="distance along the path [m]", ylabel="use of the limit, 1 at it", ylim=0.0)
    axes.legend(loc="upper right", ncols=len(COLOURS))


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
        f"path of {answer.path.length:.1f} m, {float(prediction.energy[-1]):.0f} J, "
        f"{float(prediction.time[-1]) / 60.0:.1f} min; "
        f"{answer.edges_judged} of {answer.edges} edges judged in {answer.seconds:.1f} s"
    )
