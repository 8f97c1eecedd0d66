"""Draws a study: the objective over one or two parameters, or over the trials."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rover_planner.figures.pictures import STYLE, save_figure
from rover_planner.studies.runner import StudyResult
from rover_planner.studies.study_file import OBJECTIVES

POINT, BEST, NOW = "#0072B2", "#D55E00", "#009E73"
"""Colours that are safe for colour-blind readers (Okabe and Ito); each has its own marker."""


def draw_study(result: StudyResult, path: Path) -> None:
    """Draw a study to a PNG file.

    Raises:
        PlanningError: The file cannot be written, or no trial could be judged.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.0, 4.0), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        if len(result.study.parameters) == 1:
            _draw_curve(axes, result)
        elif len(result.study.parameters) == 2:
            _draw_map(figure, axes, result)
        else:
            _draw_progress(axes, result)
        _, what, unit = OBJECTIVES[result.study.objective]
        best = result.best
        at = ", ".join(
            f"{parameter.name} {value:.4g} {parameter.unit}".rstrip()
            for parameter, value in zip(result.study.parameters, best.values, strict=True)
        )
        axes.set_title(f"{what}: best {best.objective:.4g} {unit}\nat {at}", fontsize=9)
        save_figure(path, figure)


def _label(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _draw_curve(axes: Axes, result: StudyResult) -> None:
    parameter = result.study.parameters[0]
    points = np.array(sorted((t.values[0], t.objective) for t in result.trials))
    axes.plot(points[:, 0], points[:, 1], "-o", color=POINT, markersize=3)
    now = result.baseline
    axes.plot(now.values[0], now.objective, "s", color=NOW, markersize=7, label="as it is")
    axes.plot(*_best_point(result), "o", color=BEST, markersize=8, label="best")
    axes.legend()
    _, what, unit = OBJECTIVES[result.study.objective]
    axes.set_xlabel(_label(parameter.name, parameter.unit))
    axes.set_ylabel(_label(what, unit))


def _best_point(result: StudyResult) -> tuple[float, float]:
    return result.best.values[0], result.best.objective


def _draw_map(figure: Figure, axes: Axes, result: StudyResult) -> None:
    first, second = result.study.parameters
    values = np.array([trial.values for trial in result.trials])
    objective = np.array([trial.objective for trial in result.trials])
    points = axes.scatter(values[:, 0], values[:, 1], c=objective, cmap="cividis", s=40)
    axes.plot(*result.baseline.values, "s", color=NOW, markersize=7, label="as it is")
    axes.plot(
        *result.best.values, "o", markerfacecolor="none", color=BEST, markersize=12, label="best"
    )
    axes.legend()
    _, what, unit = OBJECTIVES[result.study.objective]
    figure.colorbar(points, ax=axes, label=_label(what, unit))
    axes.set_xlabel(_label(first.name, first.unit))
    axes.set_ylabel(_label(second.name, second.unit))


def _draw_progress(axes: Axes, result: StudyResult) -> None:
    objective = np.array([trial.objective for trial in result.trials])
    best = (
        np.fmax.accumulate(objective)
        if result.study.wants_largest
        else np.fmin.accumulate(objective)
    )
    axes.plot(objective, ".", color=POINT, label="tried")
    axes.plot(best, "-", color=BEST, label="best so far")
    axes.set_xlabel("trial")
    axes.legend(frameon=False)
