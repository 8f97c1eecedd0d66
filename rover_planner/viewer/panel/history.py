# SPDX-License-Identifier: Apache-2.0
"""The values of a live rover since it is followed, for the plots."""

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.panel.plots import PLOTS
from rover_planner.viewer.state.trajectory import RoverState

SPACING = 0.01
"""Distance between two entries [m]."""
MAX_ENTRIES = 20_000
"""Most entries, of which the oldest go first: the last 200 m."""


class History:
    """Values of the plots by distance."""

    def __init__(self) -> None:
        self._distance: list[float] = []
        self._values: dict[str, list[Floats]] = {name: [] for name in PLOTS}

    def add(self, state: RoverState) -> bool:
        """Add a state if all its plotted values are known and it is SPACING beyond the last one.

        Returns:
            Whether it was added.
        """
        known = all(np.isfinite(getattr(state, name)).all() for name in PLOTS)
        if not known or (self._distance and state.distance < self._distance[-1] + SPACING):
            return False
        self._distance = [*self._distance[-MAX_ENTRIES:], state.distance]
        for name, rows in self._values.items():
            self._values[name] = [*rows[-MAX_ENTRIES:], np.asarray(getattr(state, name))]
        return True

    @property
    def distance(self) -> Floats:
        """(n,) distances driven at the entries [m]."""
        return np.array(self._distance)

    @property
    def values(self) -> dict[str, Floats]:
        """(n, ...) for each name of PLOTS."""
        return {name: np.array(rows) for name, rows in self._values.items()}
