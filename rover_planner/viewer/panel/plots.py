"""Plots of loads, friction utilisation and stability margin over distance, with a cursor."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.viewer.state.colours import REFUSED, SIDE_DASHES, WHEEL_COLOURS, to_css

MAX_POINTS = 160
"""Most points of a curve that are sent to the page."""
HEIGHT = 146
"""Height of a plot [px]; three of them fit on a laptop's screen."""


@dataclass(frozen=True)
class Plot:
    """What one plot shows."""

    title: str
    """Its title, with the unit."""
    per_wheel: bool
    """Whether it has a curve for each wheel."""
    max_value: float = np.inf
    """Larger values are cut off: a wheel that lifts off has infinite friction utilisation."""


PLOTS = {
    "wheel_loads": Plot("Wheel loads [N]", True),
    "friction_utilisation": Plot("Friction utilisation, 1 = slips", True, 1.5),
    "tip_over_ratio": Plot("Stability margin, 0 = tips over", False),
}
"""The plots by the field of `RoverState` that they show."""


class Plots:
    """Three plots in a panel of the page."""

    def __init__(self, gui: Any):
        """Add empty plots to the container that is open."""
        self.plots = {name: _add_plot(gui, plot) for name, plot in PLOTS.items()}
        gui.add_html(_legend())
        self.curves: dict[str, tuple[Floats, Floats]] = {}
        """Distances and values of the curves by the names of PLOTS."""
        self._limits: dict[str, float] = {}

    def set_curves(self, rover: Rover, distance: Floats, values: Mapping[str, Floats]) -> None:
        """Set the curves; `move_cursor` shows them.

        Args:
            rover: The rover, for its limits.
            distance: (n,) distance driven since the start [m], ascending.
            values: (n, 6) or (n,) for each name of PLOTS.
        """
        limits = rover.limits
        self._limits = {
            "friction_utilisation": limits.friction_utilisation,
            "tip_over_ratio": limits.tip_over_ratio,
        }
        self.curves = {}
        if len(distance) < 2:
            return
        rows = np.unique(np.linspace(0, len(distance) - 1, MAX_POINTS).astype(int))
        for name, plot in PLOTS.items():
            curves = values[name][rows].reshape(len(rows), -1)
            self.curves[name] = distance[rows], np.minimum(curves, plot.max_value)

    def move_cursor(self, distance: float) -> None:
        """Show the curves with the cursor at a distance [m]."""
        for name, (x, values) in self.curves.items():
            self.plots[name].data = add_cursor(x, values, distance, self._limits.get(name))


def _add_plot(gui: Any, plot: Plot) -> Any:
    from viser import uplot

    series = [uplot.Series(label="distance [m]")]
    if plot.per_wheel:
        series += [
            _line(name.replace("_", " "), colour, 1.5, SIDE_DASHES[name.endswith("left")])
            for name, colour in zip(WHEELS, WHEEL_COLOURS, strict=True)
        ]
    else:
        series.append(_line("margin", WHEEL_COLOURS[0], 2.0))
    if plot is not PLOTS["wheel_loads"]:
        series.append(_line("limit", to_css(REFUSED), 1.0, (2.0, 4.0)))
    series.append(_line("now", "#555555", 2.0))
    return gui.add_uplot(
        tuple(np.zeros(2) for _ in series),
        tuple(series),
        title=plot.title,
        height=HEIGHT,
        legend=uplot.Legend(show=False),
        scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
    )


def _line(label: str, colour: str, width: float, dash: tuple[float, ...] = ()) -> Any:
    from viser import uplot

    points = uplot.Series_Points(show=False)
    line = uplot.Series(label=label, stroke=colour, width=width, points=points)
    if dash:
        line["dash"] = dash
    return line


def _legend() -> str:
    keys = "".join(
        f'<span style="color:{colour}">&#9632;</span> {name}&ensp;'
        for name, colour in zip(("rear", "middle", "front"), WHEEL_COLOURS, strict=False)
    )
    return (
        f'<div id="plots-legend" style="font-size:11px;padding:0 8px">{keys}'
        "solid: right, dashed: left; x axis: distance [m]</div>"
    )


def add_cursor(
    x: Floats, values: Floats, distance: float, limit: float | None
) -> tuple[Floats, ...]:
    """Return the columns of a plot: x, curves, limit, and a vertical line at a distance.

    The line is a curve of its own: along the lower edge, and at the distance up and down again.
    It has no gaps, for the page cannot plot NaN.

    Args:
        x: (n,) distances [m], ascending.
        values: (n, k) curves.
        distance: Where the line is [m].
        limit: Value of a horizontal line; None for none.
    """
    at = int(np.searchsorted(x, distance))
    columns = [np.insert(x, at, [distance] * 3)]
    low, high = float(values.min()), float(values.max())
    for k in range(values.shape[1]):
        here = float(np.interp(distance, x, values[:, k]))
        columns.append(np.insert(values[:, k], at, [here] * 3))
    if limit is not None:
        columns.append(np.full(len(x) + 3, limit))
        low, high = min(low, limit), max(high, limit)
    line = np.full(len(x) + 3, low)
    line[at + 1] = high
    return (*columns, line)
