# SPDX-License-Identifier: Apache-2.0
"""The picture of the demo: a map with the answers, and what is predicted along their paths."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Patch

from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.demo.goals import Goal
from rover_planner.figures.pictures import (
    INK,
    PASSABLE,
    REFUSED,
    UNKNOWN,
    WHEEL_COLOURS,
    draw_terrain,
    drawing,
    outlined,
    zoom,
)
from rover_planner.planning.path_geometry import distance_along
from rover_planner.planning.path_query import Candidate, PathAnswer

# Ground is drawn in warm greys, so that the coloured paths stand out.
_GROUND = LinearSegmentedColormap.from_list("ground", ["#4A3F36", "#A89A8B", "#F8F3EB"])
_STRENGTH = 0.6
"""Opacity of the colours of the elevation over the shaded ground."""
_WIDE = 1.55
"""Width over height of the map, if the terrain is as wide."""
_COLUMNS = 8
_EDGE = "#E4E1DC"
_CANDIDATE: dict[str, Any] = {"lw": 1.2, "alpha": 0.95, "zorder": 3, "solid_capstyle": "round"}
_PASSES = {"label": "traversable candidate", "color": PASSABLE, **_CANDIDATE}
_FAILS = {"label": "refused candidate", "color": REFUSED, **_CANDIDATE}
_CHOSEN = {
    "label": "chosen path",
    "color": "#F0E442",
    "lw": 2.4,
    "zorder": 5,
    **outlined(4.6, INK),
}
_FAILURE: dict[str, Any] = {
    "label": "where it fails first", "color": REFUSED, "marker": "x", "ls": "", "mew": 2, "ms": 6,
    "zorder": 6, **outlined(3.5),
}  # fmt: skip
_START: dict[str, Any] = {"label": "start", "color": "white", "mec": INK, "ls": "", "ms": 17}
_ARROW = MarkerStyle([(1.0, 0.0), (-0.75, 0.6), (-0.4, 0.0), (-0.75, -0.6), (1.0, 0.0)])
_PANELS = {
    "wheel_loads": "wheel load [N]",
    "friction_utilisation": "friction\nutilisation [-]",
    "torque_saturation": "torque\nsaturation [-]",
    "tip_over_ratio": "tip-over margin\n(ratio to flat) [-]",
}
"""Quantities of a prediction that are drawn, with their labels."""
_SIDES = {"right": "-", "left": (0, (3, 1.5))}

Answered = tuple[Goal, PathAnswer]
"""A goal, and the candidates to it with their verdicts."""


def draw_answers(
    path: Path, rover: Rover, terrain: Terrain, answers: Sequence[Answered], title: str
) -> None:
    """Draw the answers to queries on one terrain.

    The upper part shows the terrain with the candidate paths, coloured by verdict. The lower part
    shows wheel loads, friction utilisation, torque saturation and tip-over margin over distance,
    up to the failure of a refused path, for up to _COLUMNS goals.

    Args:
        path: Picture to write; its suffix sets the format, such as .png.
        rover: The rover, for its limits.
        terrain: The ground.
        answers: The answers, one or more.
        title: Heading of the picture.

    Raises:
        PlanningError: The file cannot be written.
    """
    shown = list(answers)[:_COLUMNS]
    with drawing(path, (max(12.5, 2.6 * len(shown)), 15.5)) as figure:
        grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 1.05))
        above, below = (figure.add_subfigure(grid[row]) for row in (0, 1))
        figure.suptitle(title, fontsize=14, fontweight="bold")
        _draw_map(above.subplots(), terrain, answers)
        _draw_panels(below, rover, shown)


def _draw_map(axes: Axes, terrain: Terrain, answers: Sequence[Answered]) -> None:
    """Draw the terrain with the candidate paths of all answers."""
    extent = draw_terrain(axes, terrain)
    low, high = np.nanpercentile(terrain.elevation, (0.5, 99.5))
    image = axes.imshow(
        terrain.elevation, origin="lower", extent=extent, cmap=_GROUND, alpha=_STRENGTH, vmin=low,
        vmax=max(high, low + 0.05),
    )  # fmt: skip
    bar = axes.inset_axes((1.015, 0.12, 0.015, 0.76))
    axes.figure.colorbar(image, cax=bar, label="elevation [m]")
    for goal, answer in answers:
        _draw_answer(axes, goal.name, answer)
    x, y, yaw = answers[0][1].chosen.poses[0]
    axes.plot(x, y, marker=_ARROW.rotated(rad=yaw), zorder=9, **_START)
    zoom(axes, np.concatenate([c.poses[:, :2] for _, one in answers for c in one.candidates]), 1.0)
    (left, right), (low, high), (edge, other, *_) = axes.get_xlim(), axes.get_ylim(), extent
    more = max(0.5 * (_WIDE * (high - low) - (right - left)), 0.0)
    axes.set_xlim(max(left - more, min(left, edge)), min(right + more, max(right, other)))
    entries = _list_entries([axes])
    if not np.isfinite(terrain.elevation).all():
        entries["unknown ground"] = Patch(color=UNKNOWN)
    axes.legend(
        entries.values(), entries.keys(), loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=6
    )


def _list_entries(every: Iterable[Axes]) -> dict[str, Artist]:
    """Return what a legend shows: an artist for each label."""
    entries: dict[str, Artist] = {}
    for axes in every:
        handles, labels = axes.get_legend_handles_labels()
        entries |= zip(labels, handles, strict=True)
    return entries


def _draw_answer(axes: Axes, name: str, answer: PathAnswer) -> None:
    """Draw all candidates of an answer, the chosen one thick, and the goal with its name."""
    for one in answer.candidates:
        axes.plot(*one.poses[:, :2].T, **_PASSES if one.verdict.traversable else _FAILS)
        if not one.verdict.traversable:
            axes.plot(*one.poses[one.verdict.first_failure, :2], **_FAILURE)
    if answer.traversable:
        axes.plot(*answer.chosen.poses[:, :2].T, **_CHOSEN)
    x, y = answer.chosen.poses[-1, :2]
    colour = PASSABLE if answer.traversable else REFUSED
    axes.plot(x, y, "o", ms=17, color=colour, markeredgecolor="white", mew=1.5, zorder=8)
    axes.text(
        x, y, name, color="white", fontweight="bold", zorder=10, clip_on=True, ha="center",
        va="center_baseline",
    )  # fmt: skip


def _draw_panels(figure, rover: Rover, shown: Sequence[Answered]) -> None:
    """Draw a column of panels for each answer shown."""
    panels = figure.subplots(len(_PANELS), len(shown), sharex="col", sharey="row", squeeze=False)
    for column, (goal, answer) in zip(panels.T, shown, strict=True):
        column[0].set_title(_write_title(goal, answer), loc="left")
        for axes, name in zip(column, _PANELS, strict=True):
            _draw_quantity(axes, answer.chosen, name)
        column[-1].set_xlabel("distance along the path [m]")
    for row, (name, label) in zip(panels, _PANELS.items(), strict=True):
        row[0].set_ylabel(label)
        limit = vars(rover.limits).get(name)
        if limit is not None:
            for axes in row:
                axes.axhline(limit, color=INK, lw=1.0, ls=":", label="safety limit")
        most = np.inf if limit is None else 2.0 * max(limit, 1.0)
        row[0].set_ylim(0.0, min(row[0].get_ylim()[1], most))
    figure.align_ylabels(panels[:, 0])
    entries = _list_entries(panels.flat)
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=5)


def _write_title(goal: Goal, answer: PathAnswer) -> str:
    """Return the heading of a column."""
    chosen = answer.chosen
    reason = chosen.verdict.code.replace("_", " ")
    found = f"chosen path, {chosen.length:.1f} m" if answer.traversable else f"refused, {reason}"
    return f"{goal.name} ({goal.intent}):\n{found}"


def _draw_quantity(axes: Axes, candidate: Candidate, name: str) -> None:
    """Draw one predicted quantity along a path: six wheels, or one value.

    Where a wheel rolls off an edge, forces are shaded: the verdict does not ask for them.
    """
    prediction, failure = candidate.prediction, candidate.verdict.first_failure
    values, whole = np.asarray(getattr(prediction, name)), distance_along(candidate.poses)
    distance, columns = whole[: len(values)], values.reshape(len(values), -1)
    if np.allclose(columns, columns[:, :1], equal_nan=True):
        axes.plot(distance, columns[:, 0], color=INK, lw=1.3, label="rover, or all wheels alike")
    else:
        for wheel, series in zip(WHEELS, values.T, strict=True):
            position, side = wheel.split("_")
            style: dict[str, Any] = {"color": WHEEL_COLOURS[position], "ls": _SIDES[side]}
            axes.plot(distance, series, lw=1.0, label=f"{position} {side}", **style)
    if failure >= 0:
        axes.axvline(distance[failure], color=REFUSED, lw=1.2)
    axes.set_xlim(0, max(whole[-1], 1e-3))
    parts = filter(None, (prediction, prediction.between))
    off_edge = np.concatenate([part.waypoint[part.falling.any(axis=1)] for part in parts])
    for waypoint in np.unique(off_edge) if name != "tip_over_ratio" else ():
        axes.axvspan(
            distance[max(waypoint - 1, 0)], distance[waypoint], color=_EDGE, zorder=0,
            label="a wheel rolls off an edge: not asked",
        )  # fmt: skip
