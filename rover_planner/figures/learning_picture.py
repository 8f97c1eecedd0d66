# SPDX-License-Identifier: Apache-2.0
"""Draws what was learned of the ground along a drive: friction, slip, and where on the map."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.figures.pictures import INK, PASSABLE, REFUSED, draw_terrain, drawing
from rover_planner.learning.ground_learner import GroundEstimate

MOST = 1.5
"""Largest friction of the picture."""


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
        margin = 0.8
        low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        _draw_friction(below, estimates)
        _draw_slip(lowest, estimates)


def _draw_friction(axes: Axes, estimates: Sequence[GroundEstimate]) -> None:
    times = [one.time for one in estimates]
    known = [one.friction for one in estimates]
    high = [MOST if one.high is None else one.high for one in known]
    axes.fill_between(
        times, [one.low for one in known], high, color=PASSABLE, alpha=0.2, label="95 % interval"
    )
    axes.plot(times, [one.mean for one in known], color=PASSABLE, label="mean")
    _mark_times(axes, estimates[-1])
    axes.set(ylabel="friction", ylim=(0.0, MOST))
    axes.legend(loc="upper right", ncols=4)


def _draw_slip(axes: Axes, estimates: Sequence[GroundEstimate]) -> None:
    times = [one.time for one in estimates]
    ratios = np.array([one.slip_ratios for one in estimates])
    axes.plot(times, ratios, linewidth=0.7)
    _mark_times(axes, estimates[-1])
    axes.set(xlabel="time [s]", ylabel="slip ratio", ylim=(-1.0, 1.0))


def _mark_times(axes: Axes, last: GroundEstimate) -> None:
    for time, colour, label in (
        (last.slip_time, INK, "first slip"),
        (last.immobilised_time, REFUSED, "stuck"),
    ):
        if time is not None:
            axes.axvline(time, color=colour, linestyle=":", label=label)
