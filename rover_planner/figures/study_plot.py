# SPDX-License-Identifier: Apache-2.0
"""Draws a study: the objective over one or two parameters, or over the trials."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_planner.figures.pictures import WHEEL_COLOURS, drawing
from rover_planner.studies.runner import StudyResult, Trial, describe_ties
from rover_planner.studies.study_file import OBJECTIVES, label_of, name_thing

POINT, BEST = "#0072B2", "#D55E00"
NOW = {"marker": "s", "color": "#009E73", "markersize": 7, "label": "as it is"}
"""Colours that are safe for colour-blind readers (Okabe and Ito); each has its own marker."""
SIZE = (6.0, 4.0)
"""Width and height of the picture [inch]."""
EQUAL_SHARE = 1.0 / 6.0
"""Load share of a wheel if all carry alike."""


def draw_study(result: StudyResult, path: Path) -> None:
    """Draw a study to a PNG file.

    Raises:
        PlanningError: The file cannot be written, or no trial could be judged.
    """
    study, best = result.study, result.best
    _, what, unit = OBJECTIVES[study.objective]
    labels = [label_of(name_thing(one.name), one.unit) for one in study.parameters]
    at = ", ".join(
        f"{name_thing(parameter.name)} {value:.4g} {parameter.unit}".rstrip()
        for parameter, value in zip(study.parameters, best.values, strict=True)
    )
    lines = [f"{what}: best {best.objective:.4g} {unit}", f"at {at}", describe_ties(result)]
    draw = {1: _draw_curve, 2: _draw_map}.get(len(labels), _draw_progress)
    with drawing(path, SIZE) as figure:
        axes = _draw_shares(figure, result)
        draw(axes, result, [*labels, label_of(what, unit)])
        axes.set_title("\n".join(filter(None, lines)), fontsize=9)


def _draw_shares(figure: Figure, result: StudyResult) -> Axes:
    """Draw the load shares of the rover as it is and of the best; return the axes beside them.

    A study of the tallest step has none: its rovers hardly differ on level ground.
    """
    if result.study.objective == "tallest_step":
        return figure.subplots()
    figure.set_size_inches(7.4, 4.0)
    main, bars = figure.subplots(1, 2, width_ratios=(2.4, 1.0))
    for k, trial in enumerate((result.baseline, result.best)):
        for j, (axle, colour) in enumerate(WHEEL_COLOURS.items()):
            share = 0.5 * (trial.load_shares[j] + trial.load_shares[j + 3])
            x, y = k + 0.27 * (j - 1), max(share, EQUAL_SHARE) + 0.004
            bars.bar(x, share, 0.25, color=colour, label=axle if k == 0 else None)
            bars.text(x, y, f"{share:.3f}", fontsize=8, rotation=90, ha="center", va="bottom")
    bars.axhline(EQUAL_SHARE, color="black", linewidth=1.0, linestyle="--", label="equal: 1/6")
    bars.set_xticks((0, 1), ("as it is", "best"))
    bars.set_ylim(0.0, 1.5 * max(*result.best.load_shares, EQUAL_SHARE))
    bars.set_title("load share of a wheel\non level ground", fontsize=9)
    bars.grid(visible=False)
    bars.legend(fontsize=7, ncols=2, loc="upper center", columnspacing=0.8, handlelength=1.2)
    return main


def _mark(axes: Axes, trial: Trial, **style: Any) -> None:
    """Mark a trial by its first two numbers: the parameters, then the objective."""
    axes.plot(*(*trial.values, trial.objective)[:2], linestyle="", **style)


def _draw_curve(axes: Axes, result: StudyResult, labels: Sequence[str]) -> None:
    points = np.array(sorted((*t.values, t.objective) for t in result.trials))
    axes.plot(*points.T, "-o", color=POINT, markersize=3)
    if result.study.resolution:
        _draw_band(axes, result, points)
    _mark(axes, result.baseline, **NOW)
    _mark(axes, result.best, marker="o", color=BEST, markersize=8, label="best")
    for k, tie in enumerate(result.ties):
        ring: dict[str, Any] = {"marker": "o", "color": BEST, "fillstyle": "none"}
        _mark(axes, tie, markersize=10, label="as good" if k == 0 else None, **ring)
    axes.legend(fontsize=8)
    axes.set(xlabel=labels[0], ylabel=labels[1])


def _draw_band(axes: Axes, result: StudyResult, points: Floats) -> None:
    """Draw where the tallest step may lie, and which wheel ends the climb of a taller one."""
    resolution = result.study.resolution
    unit = OBJECTIVES[result.study.objective][2]
    label = f"resolution {resolution:g} {unit}"
    x, low = points.T
    axes.fill_between(x, low, low + resolution, color=POINT, alpha=0.2, linewidth=0.0, label=label)
    named: set[str] = set()
    for trial in result.trials:
        axle = next((wheel for wheel in WHEELS if wheel in trial.note), "").partition("_")[0]
        if axle:
            words = f"then a {axle} wheel fails" if axle not in named else None
            named.add(axle)
            axes.plot(trial.values[0], trial.objective + resolution, "v", markersize=5,
                      color=WHEEL_COLOURS[axle], label=words)  # fmt: skip


def _draw_map(axes: Axes, result: StudyResult, labels: Sequence[str]) -> None:
    x, y, objective = np.array([(*trial.values, trial.objective) for trial in result.trials]).T
    points = axes.scatter(x, y, c=objective, cmap="cividis", s=40)
    _mark(axes, result.baseline, **NOW)
    _mark(axes, result.best, marker="o", fillstyle="none", color=BEST, markersize=12, label="best")
    axes.legend()
    axes.figure.colorbar(points, ax=axes, label=labels[2])
    axes.set(xlabel=labels[0], ylabel=labels[1])


def _draw_progress(axes: Axes, result: StudyResult, _labels: Sequence[str]) -> None:
    objective = np.array([trial.objective for trial in result.trials])
    better = np.fmax if result.study.wants_largest else np.fmin
    axes.plot(objective, ".", color=POINT, label="tried")
    axes.plot(better.accumulate(objective), "-", color=BEST, label="best so far")
    axes.set_xlabel("trial")
    axes.legend(frameon=False)
