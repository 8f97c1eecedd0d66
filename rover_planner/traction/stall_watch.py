# SPDX-License-Identifier: Apache-2.0
"""Decides when to stop pushing: the rover is commanded to move and has not for too long."""

from statistics import median

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.traction.loops import STALL_RATIO

SLOW_SHARE = 0.1
"""Wheels whose wanted rate is below this share of the fastest one's are not looked at."""
NOT_BLOCKED = np.zeros(WHEEL_COUNT)


class StallWatch:
    """Counts the time without progress; stalled until the command is zero or reverses."""

    def __init__(self) -> None:
        """Start with a rover that moves."""
        self._time = 0.0
        self._blocked = NOT_BLOCKED

    def reset(self) -> None:
        """Forget the stall."""
        self._time, self._blocked = 0.0, NOT_BLOCKED

    def reset_time(self) -> None:
        """Start to count anew, for a rover that climbs."""
        self._time = 0.0

    def update(self, rates: Floats, wanted: Floats, duration: float, stall_time: float) -> bool:
        """Return whether the rover is stalled.

        Args:
            rates: (6,) wheel rates [rad/s].
            wanted: (6,) wanted rates of the wheels [rad/s].
            duration: Time since the last call [s].
            stall_time: Time without progress after which the rover is stalled [s].
        """
        if float(wanted @ self._blocked) > 0.0:
            return True
        self._blocked = NOT_BLOCKED
        if not wanted.any():
            self._time = 0.0
            return False
        stands = _find_progress(rates, wanted) < STALL_RATIO
        self._time = max(self._time + (duration if stands else -duration), 0.0)
        if self._time < stall_time:
            return False
        self._time, self._blocked = 0.0, wanted
        return True


def _find_progress(rates: Floats, wanted: Floats) -> float:
    """Return the median of the wheels' rates over their wanted rates."""
    slowest = SLOW_SHARE * float(np.abs(wanted).max())
    pairs = zip(rates.tolist(), wanted.tolist(), strict=True)
    return median([rate / own for rate, own in pairs if abs(own) > slowest])
