"""What a live rover has gone through since it is followed, for the plots."""

import numpy as np
from numpy.typing import NDArray

from rover_planner.viewer.panel.charts import CHARTS
from rover_planner.viewer.state.journey import Frame

Floats = NDArray[np.float64]
SPACING = 0.01
"""Way between two entries [m]."""
LONGEST = 20_000
"""Entries that are kept, the latest ones: 200 m."""


class History:
    """Values of the plots by distance."""

    def __init__(self) -> None:
        self._distance: list[float] = []
        self._values: dict[str, list[Floats]] = {name: [] for name in CHARTS}

    def add(self, frame: Frame) -> bool:
        """Keep a frame if the rover has moved on and its forces are known; return whether."""
        known = all(np.isfinite(getattr(frame, name)).all() for name in CHARTS)
        if not known or (self._distance and frame.distance < self._distance[-1] + SPACING):
            return False
        self._distance = [*self._distance[-LONGEST:], frame.distance]
        for name, rows in self._values.items():
            self._values[name] = [*rows[-LONGEST:], np.asarray(getattr(frame, name))]
        return True

    @property
    def distance(self) -> Floats:
        """(n,) way of the entries [m]."""
        return np.array(self._distance)

    @property
    def values(self) -> dict[str, Floats]:
        """(n, ...) for each name of CHARTS."""
        return {name: np.array(rows) for name, rows in self._values.items()}
