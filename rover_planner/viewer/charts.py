"""Plots of loads, utilisation and margin against distance, with a cursor that moves along."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEELS
from rover_physics.rover import Rover
from rover_planner.viewer.colours import REFUSED, css
from rover_planner.viewer.colours import WHEELS as WHEEL_COLOURS
from rover_planner.viewer.journey import Journey

Floats = NDArray[np.float64]
MOST_POINTS = 160
"""Points of a curve that are sent to the page."""
TITLES = {
    "wheel_loads": "Wheel loads [N]",
    "friction_utilisation": "Friction utilisation [-]",
    "tip_over_ratio": "Stability margin [-]",
}
HIGHEST = {"friction_utilisation": 1.5}
"""Values above are cut off: a wheel that lifts needs infinite friction."""


class Charts:
    """Three plots in a panel of the page."""

    def __init__(self, gui: Any):
        """Add empty plots to the container that is open."""
        from viser import uplot

        self._plots = {}
        for name, title in TITLES.items():
            many = name != "tip_over_ratio"
            names = WHEELS if many else ("margin",)
            series = [uplot.Series(label="distance [m]")]
            series += [
                uplot.Series(
                    label=label, stroke=WHEEL_COLOURS[k], width=1.5, points={"show": False}
                )
                for k, label in enumerate(names)
            ]
            if name != "wheel_loads":
                series.append(
                    uplot.Series(
                        label="limit",
                        stroke=css(REFUSED),
                        width=1,
                        dash=(4, 4),
                        points={"show": False},
                    )
                )
            series.append(
                uplot.Series(label="now", stroke="#777777", width=1.5, points={"show": False})
            )
            empty = tuple(np.zeros(2) for _ in series)
            self._plots[name] = gui.add_uplot(
                empty,
                tuple(series),
                title=title,
                height=150,
                legend=uplot.Legend(show=False),
                scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
            )
        keys = "".join(
            f'<span style="color:{colour}">&#9632;</span> {name.replace("_", " ")}&ensp;'
            for name, colour in zip(WHEELS, WHEEL_COLOURS, strict=True)
        )
        gui.add_html(f'<div style="font-size:11px">{keys}</div>')
        self._curves: dict[str, tuple[Floats, Floats]] = {}
        self._limits: dict[str, float] = {}

    def take(self, rover: Rover, journey: Journey) -> None:
        """Take another journey."""
        self._limits = {
            "friction_utilisation": rover.limits.friction_utilisation,
            "tip_over_ratio": rover.limits.tip_over_ratio,
        }
        self._curves = {}
        if journey.length < 2:
            return
        rows = np.unique(np.linspace(0, journey.length - 1, MOST_POINTS).astype(int))
        distance = journey.series("distance")[rows]
        for name in TITLES:
            values = journey.series(name)[rows].reshape(len(rows), -1)
            self._curves[name] = distance, np.minimum(values, HIGHEST.get(name, np.inf))

    def show(self, distance: float) -> None:
        """Move the cursor to a distance [m]."""
        for name, (x, values) in self._curves.items():
            self._plots[name].data = _with_cursor(x, values, distance, self._limits.get(name))


def _with_cursor(
    x: Floats, values: Floats, distance: float, limit: float | None
) -> tuple[Floats, ...]:
    """Return columns for a plot: x, curves, limit and an upright line at a distance.

    The line is a curve of its own that is known at two points only, both at the distance; there
    the other curves are interpolated.
    """
    at = int(np.searchsorted(x, distance))
    columns = [np.insert(x, at, [distance, distance])]
    low, high = float(values.min()), float(values.max())
    for k in range(values.shape[1]):
        here = float(np.interp(distance, x, values[:, k]))
        columns.append(np.insert(values[:, k], at, [here, here]))
    if limit is not None:
        columns.append(np.full(len(x) + 2, limit))
        low, high = min(low, limit), max(high, limit)
    line = np.full(len(x) + 2, np.nan)
    line[at : at + 2] = low, high
    return (*columns, line)
