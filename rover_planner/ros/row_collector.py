# SPDX-License-Identifier: Apache-2.0
"""Merges joint states, attitude and odometry into the rows that the ground is learned from."""

import math
from typing import Any

import numpy as np

from msg_adapters.imu import imu_to_attitude
from msg_adapters.joints import OWN_NAMES, JointNames
from msg_adapters.odometry import odometry_to_pose, odometry_to_tilt
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_planner.learning.drive_log import (
    PITCH,
    RATES,
    ROLL,
    STEERING,
    SUSPENSION,
    TIME,
    TORQUES,
    WIDTH,
    YAW,
    X,
    Y,
)
from rover_planner.learning.wheel_odometry import WheelMotion

ANGLES = {name: SUSPENSION.start + k for k, name in enumerate(SUSPENSION_JOINTS)} | {
    name: STEERING.start + k for k, name in enumerate(STEERING_JOINTS)
}
"""Columns of the angles of joints."""
WHEEL_RATES = {name: RATES.start + k for k, name in enumerate(WHEEL_JOINTS)}
WHEEL_TORQUES = {name: TORQUES.start + k for k, name in enumerate(WHEEL_JOINTS)}
"""Columns of rates and torques of the wheels."""


class RowCollector:
    """Gives a row for each odometry, with what was measured last."""

    def __init__(self, names: JointNames = OWN_NAMES) -> None:
        """Start without measurements; `names` are those of the joints in messages."""
        self._row, self._names, self._has_imu = np.full(WIDTH, np.nan), names, False
        self._yaw_rate = math.nan

    def take_joints(self, message: Any) -> None:
        """Take joint states by name; a value that is missing or not finite was not measured."""
        for values, places, has_offset in (
            (message.position, ANGLES, True),
            (message.velocity, WHEEL_RATES, False),
            (message.effort, WHEEL_TORQUES, False),
        ):
            if len(values) != len(message.name):
                continue
            for name, value in zip(message.name, values, strict=True):
                link = self._names.link(self._names.model_name(name))
                if link.model in places:
                    shift = link.offset if has_offset else 0.0
                    finite = np.isfinite(value)
                    self._row[places[link.model]] = link.sign * value + shift if finite else np.nan

    def take_imu(self, message: Any) -> None:
        """Take roll and pitch.

        Raises:
            MessageError: It has no orientation.
        """
        attitude = imu_to_attitude(message)
        self._row[[ROLL, PITCH]] = attitude.roll, attitude.pitch
        self._has_imu = True
        if attitude.rates is not None:
            _, q, r = attitude.rates.tolist()
            turn = q * math.sin(attitude.roll) + r * math.cos(attitude.roll)
            self._yaw_rate = turn / math.cos(attitude.pitch)

    def motion(self, time: float) -> WheelMotion | None:
        """Return what wheels and IMU measure at a time [s]; None until both were heard."""
        row = self._row
        if math.isnan(self._yaw_rate) or np.isnan(row[RATES]).all():
            return None
        steering = np.nan_to_num(row[STEERING])
        return WheelMotion(
            time, row[RATES].copy(), steering, row[ROLL], row[PITCH], self._yaw_rate
        )

    def take_odometry(self, message: Any, time: float, frame: str = "") -> Floats:
        """Take a pose; return the row of its time [s].

        Args:
            message: The odometry.
            time: Its time [s].
            frame: Frame that it must be in; empty takes every frame.

        Raises:
            MessageError: It has no pose that is possible, or is in another frame.
        """
        pose, _ = odometry_to_pose(message, frame or message.header.frame_id)
        self._row[[TIME, X, Y, YAW]] = time, *pose[[0, 1, 3]]
        if not self._has_imu:
            self._row[[ROLL, PITCH]] = odometry_to_tilt(message)
        return self._row.copy()
