"""The last measured joint angles and pose of the rover, with the time of each."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import SUSPENSION_JOINTS

MAX_AGE = 1.0
"""Age up to which a measurement counts as one of now [s]."""


class Measurements:
    """Keeps the last measurement of each joint and of the pose."""

    def __init__(self) -> None:
        self._joints: dict[str, float] = {}
        self._times: dict[str, float] = {}
        self._pose: NDArray[np.float64] | None = None
        self._pose_time = -np.inf

    @property
    def joints(self) -> dict[str, float]:
        """Measured angles [rad] by name, of any age."""
        return dict(self._joints)

    def take_joints(self, positions: Mapping[str, float], now: float) -> None:
        """Keep joint angles [rad] by name, measured at time `now` [s]; others stay."""
        self._joints.update(positions)
        self._times.update(dict.fromkeys(positions, now))

    def take_pose(self, pose: NDArray[np.float64], now: float) -> None:
        """Keep the pose (3,) x, y [m], yaw [rad], measured at time `now` [s]."""
        self._pose, self._pose_time = pose, now

    def pose_with_suspension(self, now: float) -> NDArray[np.float64] | None:
        """Return the pose (3,) if it and the suspension's angles are not older than MAX_AGE."""
        times = [time for name, time in self._times.items() if name in SUSPENSION_JOINTS]
        if not times or now - min(*times, self._pose_time) > MAX_AGE:
            return None
        return self._pose
