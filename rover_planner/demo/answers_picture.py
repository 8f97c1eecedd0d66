# SPDX-License-Identifier: Apache-2.0
"""Draws answers: candidate paths on the hill-shaded terrain, and wheel values along them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

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
    drawing,
    find_extent,
    outlined,
)
from rover_planner.maps.hill_shade import LEVEL_SHADE, hill_shade
from rover_planner.planning.path_geometry import distance_along
from rover_planner.planning.path_query import Candidate, PathAnswer

CHOSEN = "#F0E442"
SIDE_STYLES = {"right": "-", "left": (0, (3, 1.5))}

# Ground is drawn in warm greys, so that the coloured paths stand out.
_GROUND = LinearSegmentedColormap.from_list("ground", ["#6E6259", "#B5A99C", "#F1EAE0"])
_COLUMNS = 8
_EDGE = "#E4E1DC"


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
    extent = find_extent(terrain.origin, terrain.elevation.shape, terrain.resolution)
    view = _view(terrain, answers)
    lowest, highest = _elevation_range(terrain, view)
    axes.set_axisbelow(False)
    axes.grid(False)
    placed: dict[str, Any] = {"extent": extent, "origin": "lower"}
    image = axes.imshow(terrain.elevation, cmap=_GROUND, vmin=lowest, vmax=highest, **placed)
    axes.imshow(_shade_layer(terrain), interpolation="bilinear", zorder=1, **placed)
    bar = axes.inset_axes((1.015, 0.12, 0.015, 0.76))
    axes.figure.colorbar(image, cax=bar, label="elevation [m]")
    for _, answer in answers:
        _draw_candidates(axes, answer)
    for goal, answer in answers:
        _draw_goal(axes, goal.name, answer)
    start = answers[0][1].chosen.poses[0]
    axes.plot(*start[:2], **_start_style(start[2], 17), zorder=9)
    axes.set(xlim=view[:2], ylim=view[2:], xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal")
    axes.legend(
        handles=_map_legend(terrain), loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=6
    )


def _arrow(yaw: float) -> list[tuple[float, float]]:
    """Return the vertices of a marker: an arrow head along a heading [rad]."""
    outline = np.array([[1.0, 0.0], [-0.75, 0.6], [-0.4, 0.0], [-0.75, -0.6], [1.0, 0.0]])
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    return [(float(x), float(y)) for x, y in outline @ turn]


def _start_style(yaw: float, size: float) -> dict[str, Any]:
    """Return how a start with a heading [rad] is drawn."""
    edge = {"color": "white", "markeredgecolor": INK}
    return {"marker": _arrow(yaw), "ls": "", "markersize": size, **edge}


def _key(label: str, **style: Any) -> Line2D:
    """Return an entry of a legend."""
    return Line2D([], [], label=label, **style)


def _map_legend(terrain: Terrain) -> list[Line2D]:
    """Return the handles of the map's legend."""
    handles = [
        _key("chosen path", color=CHOSEN, lw=3, **outlined(5, INK)),
        _key("traversable candidate", color=PASSABLE, lw=1.6),
        _key("refused candidate", color=REFUSED, lw=1.6),
        _key("where it fails first", color=REFUSED, marker="x", ls="", mew=2),
        _key("start", **_start_style(0.5 * np.pi, 10)),
    ]
    if not np.isfinite(terrain.elevation).all():
        square: dict[str, Any] = {"marker": "s", "ls": "", "markersize": 9}
        handles.append(_key("unknown ground", color=UNKNOWN, markeredgecolor="#888888", **square))
    return handles


def _shade_layer(terrain: Terrain) -> NDArray[np.float64]:
    """Return the hill shade as RGBA (ny, nx, 4): black or white with opacity.

    Unknown cells are opaque.
    """
    shade = hill_shade(terrain.elevation, terrain.resolution)
    shade = np.where(np.isfinite(shade), shade, LEVEL_SHADE)
    light = np.where(shade > LEVEL_SHADE, 1.0, 0.0)
    depth = np.abs(shade - LEVEL_SHADE)
    layer = np.repeat(light[:, :, None], 4, axis=2)
    layer[:, :, 3] = np.clip(np.where(light > 0, 1.8, 1.35) * depth, 0, 0.9)
    layer[np.isnan(terrain.elevation)] = (*to_rgb(UNKNOWN), 1.0)
    return layer


def _draw_candidates(axes: Axes, answer: PathAnswer) -> None:
    """Draw all candidates of an answer, the chosen one last and thick."""
    for candidate in answer.candidates:
        colour = PASSABLE if candidate.verdict.traversable else REFUSED
        thin: dict[str, Any] = {"lw": 1.2, "alpha": 0.95, "zorder": 3, "solid_capstyle": "round"}
        axes.plot(*candidate.poses[:, :2].T, color=colour, **thin)
    refused = [one for one in answer.candidates if not one.verdict.traversable]
    if refused:
        spots = np.array([one.poses[one.verdict.first_failure, :2] for one in refused])
        cross: dict[str, Any] = {"color": REFUSED, "mew": 2, "ms": 6, "zorder": 6}
        axes.plot(*spots.T, "x", **cross, **outlined(3.5))
    if answer.traversable:
        thick: dict[str, Any] = {"color": CHOSEN, "lw": 2.4, "zorder": 5}
        axes.plot(*answer.chosen.poses[:, :2].T, **thick, **outlined(4.6, INK))


def _draw_goal(axes: Axes, name: str, answer: PathAnswer) -> None:
    """Mark a goal with its name in the colour of the verdict."""
    x, y = answer.chosen.poses[-1, :2]
    colour = PASSABLE if answer.traversable else REFUSED
    axes.plot(x, y, "o", ms=17, color=colour, markeredgecolor="white", mew=1.5, zorder=8)
    middle: dict[str, Any] = {"ha": "center", "va": "center_baseline"}
    axes.text(x, y, name, color="white", fontweight="bold", zorder=10, clip_on=True,
              **middle)  # fmt: skip


def _view(terrain: Terrain, answers: Sequence[Answered]) -> tuple[float, ...]:
    """Return xmin, xmax, ymin, ymax [m] of the visible area: all paths and a margin."""
    places = np.concatenate([c.poses[:, :2] for _, answer in answers for c in answer.candidates])
    lower, upper = places.min(axis=0), places.max(axis=0)
    margin = 0.08 * float(max(upper - lower)) + 0.5
    lower, upper = lower - margin, upper + margin
    # a wide view fills the page; the view includes the terrain's edges if paths leave it
    wanted = 1.55 * (upper[1] - lower[1])
    lack = max(0.0, wanted - (upper[0] - lower[0]))
    xmin, xmax, _, _ = terrain.bounds
    room_left = max(0.0, lower[0] - xmin)
    room_right = max(0.0, xmax - upper[0])
    left = min(room_left, max(0.5 * lack, lack - room_right))
    right = min(room_right, lack - left)
    return (lower[0] - left, upper[0] + right, lower[1], upper[1])


def _elevation_range(
    terrain: Terrain, view: tuple[float, ...]
) -> tuple[float | None, float | None]:
    """Return minimum and maximum elevation [m] in view, for the colours."""
    ny, nx = terrain.elevation.shape
    x = terrain.origin[0] + terrain.resolution * np.arange(nx)
    y = terrain.origin[1] + terrain.resolution * np.arange(ny)
    columns, rows = (x >= view[0]) & (x <= view[1]), (y >= view[2]) & (y <= view[3])
    seen = terrain.elevation[np.ix_(rows, columns)]
    seen = seen[np.isfinite(seen)]
    if not len(seen):
        return None, None
    low, high = np.percentile(seen, [0.5, 99.5])
    return float(low), float(max(high, low + 0.05))


def _draw_panels(figure, rover: Rover, shown: Sequence[Answered]) -> None:
    """Draw a column of panels for each answer shown."""
    limits = rover.limits
    rows = (
        ("wheel load [N]", "wheel_loads", None),
        ("friction\nutilisation [-]", "friction_utilisation", limits.friction_utilisation),
        ("torque\nsaturation [-]", "torque_saturation", limits.torque_saturation),
        ("tip-over margin\n(ratio to flat) [-]", "tip_over_ratio", limits.tip_over_ratio),
    )
    panels = figure.subplots(len(rows), len(shown), sharex="col", sharey="row", squeeze=False)
    for column, (goal, answer) in enumerate(shown):
        candidate = answer.chosen
        panels[0, column].set_title(_panel_title(goal, answer), loc="left")
        for row, (label, name, limit) in enumerate(rows):
            axes = panels[row, column]
            _draw_quantity(axes, candidate, name)
            if name != "tip_over_ratio":
                _shade_edges(axes, candidate)
            if limit is not None:
                axes.axhline(limit, color=INK, lw=1.0, ls=":")
            if column == 0:
                axes.set_ylabel(label)
        panels[-1, column].set_xlabel("distance along the path [m]")
    for row, (_, name, limit) in enumerate(rows):
        highest = max(_highest(answer.chosen, name) for _, answer in shown)
        if limit is not None:
            highest = max(limit, min(highest, 2 * max(limit, 1.0)))
        panels[row, 0].set_ylim(0, 1.08 * max(highest, 1e-3))
    figure.align_ylabels(panels[:, 0])
    figure.legend(handles=_wheel_legend(), loc="outside lower center", ncols=5)


def _highest(candidate: Candidate, name: str) -> float:
    """Return the largest finite value of a predicted quantity, 0 if there is none."""
    values = np.asarray(getattr(candidate.prediction, name))
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def _panel_title(goal: Goal, answer: PathAnswer) -> str:
    """Return the heading of a column."""
    chosen = answer.chosen
    if answer.traversable:
        return f"{goal.name} ({goal.intent}):\nchosen path, {chosen.length:.1f} m"
    reason = chosen.verdict.code.replace("_", " ")
    return f"{goal.name} ({goal.intent}):\nrefused, {reason}"


def _draw_quantity(axes: Axes, candidate: Candidate, name: str) -> None:
    """Draw one predicted quantity along a path: six wheels, or one value."""
    values = np.asarray(getattr(candidate.prediction, name))
    whole = distance_along(candidate.poses)
    distance, columns = whole[: len(values)], values.reshape(len(values), -1)
    if np.allclose(columns, columns[:, :1], equal_nan=True):
        axes.plot(distance, columns[:, 0], color=INK, lw=1.3)
    else:
        for wheel, series in zip(WHEELS, values.T, strict=True):
            position, side = wheel.split("_")
            axes.plot(
                distance, series, color=WHEEL_COLOURS[position], ls=SIDE_STYLES[side], lw=1.0
            )
    failure = candidate.verdict.first_failure
    if failure >= 0:
        axes.axvline(distance[failure], color=REFUSED, lw=1.2)
    axes.set_xlim(0, max(whole[-1], 1e-3))


def _shade_edges(axes: Axes, candidate: Candidate) -> None:
    """Shade where a wheel rolls off an edge: the verdict does not ask for forces there."""
    distance, prediction = distance_along(candidate.poses), candidate.prediction
    parts = filter(None, (prediction, prediction.between))
    off_edge = [part.waypoint[part.falling.any(axis=1)] for part in parts]
    for waypoint in np.unique(np.concatenate(off_edge)):
        axes.axvspan(distance[max(waypoint - 1, 0)], distance[waypoint], color=_EDGE, zorder=0)


def _wheel_legend() -> list[Line2D | Patch]:
    """Return the legend handles of the wheels."""
    return [
        *(
            _key(f"{position} {side}", color=WHEEL_COLOURS[position], ls=SIDE_STYLES[side], lw=1.6)
            for position in ("front", "middle", "rear")
            for side in ("left", "right")
        ),
        _key("rover, or all wheels alike", color=INK, lw=1.3),
        _key("safety limit", color=INK, lw=1.0, ls=":"),
        Patch(color=_EDGE, label="a wheel rolls off an edge: not asked"),
    ]
