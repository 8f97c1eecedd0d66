# SPDX-License-Identifier: Apache-2.0
"""Draws advice: the refused path and those of the remedies, and the largest use along each."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from rover_planner.advice.advise import Advice
from rover_planner.advice.case import JudgedCase
from rover_planner.figures.pictures import REFUSED, draw_terrain, drawing, outlined

COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours of the remedies."""
MARGIN = 1.0
"""Ground that is shown around the paths [m]."""
MOST_USE = 1.6
"""Largest use that is shown."""


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
        low, high = shown[:, :2].min(axis=0) - MARGIN, shown[:, :2].max(axis=0) + MARGIN
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_title(
            f"{case.rover.name} on {map_name}: {advice.describe()}", loc="left", wrap=True
        )
        below.axhline(1.0, color=REFUSED, linestyle=":", linewidth=1.2)
        below.set(
            xlabel="distance along the path [m]",
            ylabel="largest use of a limit",
            ylim=(0.0, MOST_USE),
        )
        figure.legend(*below.get_legend_handles_labels(), loc="outside lower left", fontsize=8)


def _draw_case(axes: Axes, below: Axes, judged: JudgedCase, colour: str, label: str) -> None:
    """Draw a path on the ground, and the largest use along it below."""
    x, y, _ = judged.case.poses.T
    axes.plot(x, y, color=colour, linewidth=1.8, **outlined(4.0))
    use = np.fmin(judged.use, MOST_USE)
    below.plot(judged.distance[: len(use)], use, color=colour, linewidth=1.2, label=label)
