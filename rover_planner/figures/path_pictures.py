# SPDX-License-Identifier: Apache-2.0
"""Draws paths on the shaded map with curves along them: a plan, advice, a drive that taught."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from rover_physics.numerics.arrays import Floats
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.advice.advise import Advice
from rover_planner.advice.case import JudgedCase
from rover_planner.figures.pictures import (
    INK,
    PASSABLE,
    REFUSED,
    draw_terrain,
    drawing,
    find_extent,
    outlined,
    zoom,
)
from rover_planner.learning.ground_learner import GroundEstimate
from rover_planner.planning.asked_poses import merge_poses
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import SearchQuery

COLOURS, FAINT = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"), "#BBBBBB"
"""Colours of remedies and of the most used limits, and of other limits."""
NAMED = 4
"""Number of the most used limits that are named."""
MOST_USE = 1.6
"""Largest use that is shown of advice."""
MOST_FRICTION = 1.5
"""Largest friction of a drive's curve."""


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
        shown = k < NAMED
        colour, width = (COLOURS[k], 1.4) if shown else (FAINT, 0.8)
        label = title if shown else None
        axes.plot(rows.distance, of_title[title], color=colour, lw=width, label=label)
    _label_uses(axes, "use of the limit, 1 at it")
    axes.set(ylim=0.0)
    axes.legend(loc="upper right", ncols=NAMED)


def _label_uses(axes: Axes, label: str) -> None:
    """Draw a line at the limit, and label the axes of uses along a path."""
    axes.axhline(1.0, color=REFUSED, linestyle=":", linewidth=1.2)
    axes.set(xlabel="distance along the path [m]", ylabel=label)


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


def draw_advice(path: Path, advice: Advice, map_name: str) -> None:
    """Draw the paths on the ground, and the largest use of a limit along them.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        advice: The advice.
        map_name: Name of the map.

    Raises:
        PlanningError: The file cannot be written.
    """
    case, terrain = advice.judged.case, advice.judged.case.terrain
    with drawing(path, (9.0, 10.0)) as figure:
        axes, below = figure.subplots(2, height_ratios=(2.2, 1.0))
        draw_terrain(axes, terrain)
        for colour, remedy in zip(COLOURS, advice.remedies, strict=False):
            _draw_case(axes, below, remedy.judged, colour, remedy.describe())
        _draw_case(axes, below, advice.judged, REFUSED, f"refused: {advice.judged.verdict.reason}")
        if not advice.judged.passes:
            place = case.poses[advice.judged.verdict.first_failure]
            axes.plot(*place[:2], "X", color=REFUSED, markersize=11, markeredgecolor="white")
        shown = np.concatenate([case.poses, *(one.judged.case.poses for one in advice.remedies)])
        zoom(axes, shown[:, :2], 1.0)
        axes.set_title(
            f"{case.rover.name} on {map_name}: {advice.describe()}", loc="left", wrap=True
        )
        _label_uses(below, "largest use of a limit")
        below.set(ylim=(0.0, MOST_USE))
        figure.legend(*below.get_legend_handles_labels(), loc="outside lower left", fontsize=8)


def _draw_case(axes: Axes, below: Axes, judged: JudgedCase, colour: str, label: str) -> None:
    """Draw a path on the ground, and the largest use along it below."""
    x, y, _ = judged.case.poses.T
    axes.plot(x, y, color=colour, linewidth=1.8, **outlined(4.0))
    use = np.fmin(judged.use, MOST_USE)
    below.plot(judged.distance[: len(use)], use, color=colour, linewidth=1.2, label=label)


def draw_learning(
    path: Path,
    terrain: Terrain,
    places: Floats,
    estimates: Sequence[GroundEstimate],
    friction: Floats,
) -> None:
    """Draw estimates along a drive.

    Args:
        path: Picture to write; its suffix sets the format.
        terrain: The map.
        places: (n, 2) x, y [m] of the body at the estimates.
        estimates: n estimates.
        friction: (ny, nx) layer of the learned friction, NaN where no wheel has been.

    Raises:
        PlanningError: The file cannot be written.
    """
    with drawing(path, (8.5, 8.0)) as figure:
        axes, below, lowest = figure.subplots(3, height_ratios=(2.0, 1.0, 0.8))
        extent = draw_terrain(axes, terrain)
        image = axes.imshow(
            friction, origin="lower", extent=extent, vmin=0.0, vmax=1.2, cmap="cividis", alpha=0.8
        )
        figure.colorbar(image, ax=axes, label="friction")
        axes.plot(*places.T, color=INK, linewidth=1.0)
        zoom(axes, places, 0.8)
        times, known = [one.time for one in estimates], [one.friction for one in estimates]
        low, mean = [one.low for one in known], [one.mean for one in known]
        high = [MOST_FRICTION if one.high is None else one.high for one in known]
        below.fill_between(times, low, high, color=PASSABLE, alpha=0.2, label="95 % interval")
        below.plot(times, mean, color=PASSABLE, label="mean")
        lowest.plot(times, np.array([one.slip_ratios for one in estimates]), linewidth=0.7)
        last = estimates[-1]
        events = (
            (last.slip_time, INK, "first slip"),
            (last.immobilised_time, REFUSED, "stuck"),
        )
        for time, colour, label in events:
            if time is not None:
                below.axvline(time, color=colour, linestyle=":", label=label)
                lowest.axvline(time, color=colour, linestyle=":")
        below.set(ylabel="friction", ylim=(0.0, MOST_FRICTION))
        below.legend(loc="upper right", ncols=4)
        lowest.set(xlabel="time [s]", ylabel="slip ratio", ylim=(-1.0, 1.0))
