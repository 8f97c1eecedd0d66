# SPDX-License-Identifier: Apache-2.0
"""Notices that a rover stands on its way, and how often it has stopped at one place."""

import math

import numpy as np
from numpy.typing import NDArray

from rover_planner.planning.angles import wrap
from rover_planner.planning.navigation.watched_path import TURN_LENGTH

Pose = NDArray[np.float64]
"""(3,) x, y [m] and yaw [rad], map frame."""
STILL = 0.02
"""Motion below which a rover stands [m]; a turn counts as in `WatchedPath`."""
SAME_PLACE = 0.1
"""Distance below which two stops are at one place [m]."""


class Standstill:
    """Notices that a rover does not get on."""

    def __init__(self, patience: float):
        """Begin with a rover that moves.

        Args:
            patience: Time for which it may stand [s].
        """
        self._patience = patience
        self._pose: Pose | None = None
        self._since = 0.0

    def is_reached(self, pose: Pose, now: float) -> bool:
        """Return whether the rover has stood for too long.

        Args:
            pose: Where the rover is.
            now: Time [s].
        """
        if self._pose is None or _is_away(pose, self._pose):
            self._pose, self._since = pose, now
        return now - self._since > self._patience


class Stops:
    """Counts the stops at one place."""

    def __init__(self) -> None:
        """Begin without a stop."""
        self._place: Pose | None = None
        self._count = 0

    def count(self, pose: Pose) -> int:
        """Return how often in turn the rover (3,) has stopped where it stops now."""
        is_same = self._place is not None and math.dist(pose[:2], self._place[:2]) < SAME_PLACE
        self._count = self._count + 1 if is_same else 1
        self._place = pose
        return self._count


def _is_away(pose: Pose, other: Pose) -> bool:
    """Return whether two poses (3,) differ by more than a rover that stands moves."""
    turn = TURN_LENGTH * float(wrap(pose[2] - other[2]))
    return math.hypot(*(pose[:2] - other[:2]), turn) > STILL
