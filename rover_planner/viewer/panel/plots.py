# SPDX-License-Identifier: Apache-2.0
"""Plots of loads, friction utilisation and stability margin over distance, with a cursor."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.figures.wheel_colours import LEFT_DASHES, WHEEL_COLOURS, colour_of
from rover_planner.viewer.panel.lanes import Lanes
from rover_planner.viewer.state.colours import REFUSED, Colour, blend, to_css

MAX_POINTS = 160
"""Most points of a curve that are sent to the page."""
HEIGHT = 96
"""Height of a plot [px]; three of them and the lanes fit on a laptop's screen."""
AXIS_HEIGHT, AXIS_WIDTH = 24, 50
"""Height of the axis below a plot and width of the one beside it [px]."""
PALE = 0.62
"""Share of white in the curves of the rover before."""
WHITE = (255, 255, 255)


@dataclass(frozen=True)
class Plot:
    """Description of one plot."""

    title: str
    """Its title, with the unit."""
    per_wheel: bool
    """True if it has a curve for each wheel."""
    max_value: float = np.inf
    """Larger values are cut off: a wheel that lifts off has infinite friction utilisation."""
    from_zero: bool = True
    """True if its axis begins at zero."""


PLOTS = {
    "wheel_loads": Plot("Wheel loads [N]", True),
    "friction_utilisation": Plot("Friction utilisation, 1 = slips", True, 1.5),
    "tip_over_ratio": Plot("Stability margin, 0 = tips over", False),
}
"""The plots by the field of `RoverState` that they show."""


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of all plots along one drive."""

    distance: Floats
    """(n,) distance driven since the start [m], ascending."""
    values: Mapping[str, Floats]
    """(n, 6) or (n,) for each name of PLOTS."""


class Plots:
    """Lanes of the limits and three plots in a panel of the page, with one cursor."""

    def __init__(self, gui: Any):
        """Add empty lanes and plots to the container that is open."""
        self.lanes = Lanes(gui)
        self.plots = {name: _add_plot(gui, name, plot) for name, plot in PLOTS.items()}
        gui.add_html(_legend())
        self.curves: dict[str, tuple[Floats, Floats]] = {}
        """Distances and values of the curves by the names of PLOTS, those before in front."""
        self.limits: dict[str, float] = {}
        """Limits by the names of PLOTS; 0 where there is none."""
        self._failure_at: float | None = None

    def set_curves(
        self,
        rover: Rover,
        curves: Curves,
        before: Curves | None = None,
        failure_at: float | None = None,
        friction_limit: float | None = None,
    ) -> None:
        """Set the curves; `move_cursor` shows them.

        Args:
            rover: The rover, for its limits.
            curves: The curves.
            before: Those of the rover before, which are drawn pale (default: none).
            failure_at: Distance of the first failure [m]; None without one.
            friction_limit: Limit of the friction utilisation (default: the rover's); infinite if
                it has none, as with speed servos. Its line then lies along the lower edge.
        """
        limits = rover.limits
        friction = limits.friction_utilisation if friction_limit is None else friction_limit
        self.limits = {
            "friction_utilisation": friction if math.isfinite(friction) else 0.0,
            "tip_over_ratio": limits.tip_over_ratio,
        }
        self._failure_at = failure_at
        self.curves = {}
        distance = curves.distance
        if len(distance) < 2:
            return
        for name, plot in PLOTS.items():
            rows = choose_rows(np.asarray(curves.values[name]).reshape(len(distance), -1))
            x = distance[rows]
            now = curves.values[name][rows].reshape(len(rows), -1)
            old = now if before is None else _resample(before, name, x, now)
            both = np.hstack([old, now])
            self.curves[name] = x, np.minimum(both, plot.max_value)

    def move_cursor(self, distance: float) -> None:
        """Show the curves and the lanes with the cursor at a distance [m]."""
        for name, (x, values) in self.curves.items():
            columns = (x, *values.T)
            if name in self.limits:
                columns = (*columns, np.full(len(x), self.limits[name]))
            low = min(float(column.min()) for column in columns[1:])
            low = min(low, 0.0) if PLOTS[name].from_zero else low
            columns = add_line(columns, self._failure_at, low)
            self.plots[name].data = add_line(columns, distance, low)
        self.lanes.move_cursor(distance)


def choose_rows(values: Floats) -> NDArray[np.intp]:
    """Return at most MAX_POINTS rows of curves (n, k): first, last, and all peaks and dips.

    A peak between two waypoints is what refuses a path; it must not be left out.
    """
    n = len(values)
    if n <= MAX_POINTS:
        return np.arange(n)
    edges = np.linspace(0, n, MAX_POINTS // 2).astype(int)
    high, low = values.max(axis=1), values.min(axis=1)
    chosen = [
        first + int(pick)
        for first, end in itertools.pairwise(edges)
        for pick in (np.argmax(high[first:end]), np.argmin(low[first:end]))
    ]
    return np.unique([0, *chosen, n - 1])


def _resample(before: Curves, name: str, x: Floats, now: Floats) -> Floats:
    """Return the curves before (n, k) at distances x (n,), those of now where they have ended.

    There they are hidden behind those of now; the page cannot plot gaps.
    """
    if not len(before.distance):
        return now
    values = before.values[name].reshape(len(before.distance), -1)
    columns = [np.interp(x, before.distance, values[:, k]) for k in range(values.shape[1])]
    is_known = (x <= before.distance[-1] + 1e-6)[:, None]
    return np.where(is_known, np.column_stack(columns), now)


def _add_plot(gui: Any, name: str, plot: Plot) -> Any:
    from viser import uplot

    if plot.per_wheel:
        curves = [(wheel.replace("_", " "), colour_of(wheel), _dash(wheel)) for wheel in WHEELS]
    else:
        curves = [("margin", WHEEL_COLOURS["rear"], ())]
    series = [uplot.Series(label="distance [m]")]
    series += [_line(f"{what} before", _fade(colour), 1.5, dash) for what, colour, dash in curves]
    series += [_line(what, colour, 1.5, dash) for what, colour, dash in curves]
    if name != "wheel_loads":
        series.append(_line("limit", to_css(REFUSED), 1.0, (2.0, 4.0)))
    series.append(_line("fails", to_css(REFUSED), 2.0))
    series.append(_line("now", "#555555", 2.0))
    return gui.add_uplot(
        tuple(np.zeros(2) for _ in series),
        tuple(series),
        title=plot.title,
        height=HEIGHT,
        padding=(8, 14, 0, 0),
        legend=uplot.Legend(show=False),
        axes=(uplot.Axis(size=AXIS_HEIGHT), uplot.Axis(size=AXIS_WIDTH)),
        scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
    )


def _dash(wheel: str) -> tuple[float, ...]:
    return LEFT_DASHES if wheel.endswith("left") else ()


def _fade(colour: str) -> str:
    """Return the pale colour of a curve of the rover before."""
    strong: Colour = (int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16))
    return to_css(blend(strong, WHITE, PALE))


def _line(label: str, colour: str, width: float, dash: tuple[float, ...] = ()) -> Any:
    from viser import uplot

    points = uplot.Series_Points(show=False)
    line = uplot.Series(label=label, stroke=colour, width=width, points=points)
    if dash:
        line["dash"] = dash
    return line


def _legend() -> str:
    keys = "".join(
        f'<span style="color:{colour}">&#9632;</span> {name} '
        for name, colour in WHEEL_COLOURS.items()
    )
    return (
        f'<div id="plots-legend" style="font-size:12px;line-height:1.3;padding:0 8px">{keys}'
        "&mdash; right - - left; over the distance [m]</div>"
    )


def add_line(columns: tuple[Floats, ...], at: float | None, low: float) -> tuple[Floats, ...]:
    """Return the columns of a plot with one more, a vertical line at a distance.

    The line is a curve of its own: along the lower edge, and at the distance up and down again.
    It has no gaps, for the page cannot plot NaN.

    Args:
        columns: Distances [m], ascending, and curves, each (n,).
        at: Where the line is [m]; None: it lies along the lower edge.
        low: Lower end of the line.
    """
    x, *curves = columns
    if at is None:
        return (*columns, np.full(len(x), low))
    row = int(np.searchsorted(x, at))
    line = np.full(len(x) + 3, low)
    line[row + 1] = max(float(curve.max()) for curve in curves)
    widened = [np.insert(curve, row, [np.interp(at, x, curve)] * 3) for curve in curves]
    return (np.insert(x, row, [at] * 3), *widened, line)
