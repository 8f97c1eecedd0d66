# SPDX-License-Identifier: Apache-2.0
"""The last measured joint angles and pose of the rover, with the time of each."""

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.maps.ground_beneath import Standing

MAX_AGE = 1.0
"""Age up to which a measurement counts as one of now [s]."""


class Measurements:
    """Keeps the last measurement of each joint and of the pose."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin without any; `clock` returns the time [s] that they age by."""
        self._clock = clock
        self._joints: dict[str, float] = {}
        self._times: dict[str, float] = {}
        self._pose: NDArray[np.float64] | None = None
        self._pose_time = -np.inf
        self._body: tuple[float, float, float] | None = None
        self._tilt: tuple[float, float] | None = None
        self._tilt_time = -np.inf

    @property
    def joints(self) -> dict[str, float]:
        """Measured angles [rad] by name, of any age."""
        return dict(self._joints)

    def take_joints(self, positions: Mapping[str, float]) -> None:
        """Keep measured joint angles [rad] by name; angles of other joints stay."""
        self._joints.update(positions)
        self._times.update(dict.fromkeys(positions, self._clock()))

    def take_pose(
        self, pose: NDArray[np.float64], body: tuple[float, float, float] | None = None
    ) -> None:
        """Keep the measured pose (3,) x, y [m], yaw [rad] of the body, map frame.

        `body` is z [m], roll and pitch [rad] of the body at the same time; None: not measured.
        """
        self._pose, self._pose_time, self._body = pose, self._clock(), body

    def take_tilt(self, roll: float, pitch: float) -> None:
        """Keep roll and pitch [rad] of the body, measured by an IMU."""
        self._tilt, self._tilt_time = (roll, pitch), self._clock()

    def standing(self) -> Standing | None:
        """Return pose and suspension if all of them are not older than MAX_AGE, else None.

        Roll and pitch are those of the IMU if there ever was one, else those of the pose.
        """
        now = self._clock()
        times = [self._times.get(name, -np.inf) for name in SUSPENSION_JOINTS]
        pose, body = self._pose, self._body
        if pose is None or body is None or now - min(*times, self._pose_time) > MAX_AGE:
            return None
        if self._tilt is not None:
            if now - self._tilt_time > MAX_AGE:
                return None
            body = body[0], *self._tilt
        suspension = {name: self._joints[name] for name in SUSPENSION_JOINTS}
        x, y, yaw = pose.tolist()
        return Standing(x, y, *body, yaw, suspension)

    def fresh_pose(self, max_age: float = MAX_AGE) -> NDArray[np.float64] | None:
        """Return the pose (3,) x, y [m], yaw [rad] if it is not older than `max_age` [s]."""
        return self._pose if self._clock() - self._pose_time <= max_age else None

    def pose_with_suspension(self) -> NDArray[np.float64] | None:
        """Return the pose (3,) if it and the suspension's angles are not older than MAX_AGE."""
        times = [time for name, time in self._times.items() if name in SUSPENSION_JOINTS]
        if not times or self._clock() - min(*times, self._pose_time) > MAX_AGE:
            return None
        return self._pose

