"""How far a rover is along its plan, from measured poses."""

import numpy as np
from numpy.typing import NDArray

from rover_planner.planning.angles import wrap

LOOK_AHEAD = 1.0
"""Length of plan ahead of the last known place within which the rover is looked for [m]."""
TURN = 0.5
"""Metres that count as much as a turn by one radian."""


class PlanProgress:
    """The place of a rover on its plan; it never goes back."""

    def __init__(self, plan: NDArray[np.float64]):
        """Begin at the first pose of a plan (n, 3), x, y [m] and yaw [rad], map frame."""
        self.plan = np.asarray(plan, float)
        """(n, 3) poses."""
        steps = np.hypot(*np.diff(self.plan[:, :2], axis=0).T)
        turns = np.abs(wrap(np.diff(self.plan[:, 2])))
        self._along = np.concatenate([[0.0], np.cumsum(steps + TURN * turns)])
        self._index = 0

    def advance(self, pose: NDArray[np.float64]) -> None:
        """Take a measured pose (3,)."""
        last = int(np.searchsorted(self._along, self._along[self._index] + LOOK_AHEAD, "right"))
        ahead = self.plan[self._index : last]
        away = np.hypot(*(ahead[:, :2] - pose[:2]).T) + TURN * np.abs(wrap(ahead[:, 2] - pose[2]))
        self._index += int(np.argmin(away))

    @property
    def rest(self) -> NDArray[np.float64]:
        """(n, 3) poses of the plan that are still ahead, the nearest one first."""
        return self.plan[self._index :]

    def is_over(self, pose: NDArray[np.float64], within: float) -> bool:
        """Return whether the rover is at the end, and no turn on the spot is left before it.

        Args:
            pose: (3,) measured pose.
            within: Distance from the end that counts as there [m].
        """
        left = self._along[-1] - self._along[self._index]
        return bool(np.hypot(*(self.plan[-1, :2] - pose[:2])) < within and left < 2.0 * within)
