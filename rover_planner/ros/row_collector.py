# SPDX-License-Identifier: Apache-2.0
"""Merges joint states, attitude and odometry into the rows that the ground is learned from."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from msg_adapters.joints import OWN_NAMES, JointNames
from msg_adapters.sensors import ImuMounting, imu_to_attitude, odometry_to_pose
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
from rover_planner.learning.wheel_slip import LONGEST_GAP

_POSITIONS = dict(zip(SUSPENSION_JOINTS, range(WIDTH)[SUSPENSION], strict=True)) | dict(
    zip(STEERING_JOINTS, range(WIDTH)[STEERING], strict=True)
)
_VELOCITIES = dict(zip(WHEEL_JOINTS, range(WIDTH)[RATES], strict=True))
_EFFORTS = dict(zip(WHEEL_JOINTS, range(WIDTH)[TORQUES], strict=True))
"""Columns of the measurements by joint."""


class RowCollector:
    """Gives a row for each odometry, with what was measured last.

    What came more than LONGEST_GAP ago was not measured: the sensor or its driver has ended. The
    last steering angles hold on, as a wheel that is not steered stays.
    """

    def __init__(self, names: JointNames = OWN_NAMES, mounting: ImuMounting | None = None) -> None:
        """Start without measurements.

        Args:
            names: Names of the joints in messages.
            mounting: Of the IMU, as for `imu_to_attitude`.
        """
        self._row, self._names, self._has_imu = np.full(WIDTH, np.nan), names, False
        self._came = np.full(WIDTH, -math.inf)
        self._mounting = mounting
        self.yaw_rate = math.nan
        """Yaw rate by the IMU [rad/s]; NaN before it was measured."""

    def take_joints(self, message: Any, now: float) -> None:
        """Take joint states by name; a value that is missing or not finite was not measured.

        Args:
            message: The joint states.
            now: Time of their arrival [s].

        Raises:
            MessageError: A joint occurs twice.
        """
        self._keep(message.name, message.position, _POSITIONS, now, are_angles=True)
        self._keep(message.name, message.velocity, _VELOCITIES, now)
        self._keep(message.name, message.effort, _EFFORTS, now)

    def _keep(
        self,
        names: Sequence[str],
        values: Sequence[float],
        columns: Mapping[str, int],
        now: float,
        *,
        are_angles: bool = False,
    ) -> None:
        if len(values) != len(names):
            return
        for place, link in self._names.places(names, columns):
            value = link.sign * values[place] + (link.offset if are_angles else 0.0)
            column = columns[link.model]
            self._row[column] = value if math.isfinite(value) else math.nan
            self._came[column] = now

    def take_imu(self, message: Any, now: float) -> None:
        """Take roll and pitch of an IMU that arrives at a time [s].

        Raises:
            MessageError: As `imu_to_attitude`.
        """
        attitude = imu_to_attitude(message, self._mounting)
        self._row[[ROLL, PITCH]] = attitude.roll, attitude.pitch
        self._came[[ROLL, PITCH]] = now
        self._has_imu = True
        if attitude.rates is not None:
            _, q, r = attitude.rates.tolist()
            turn = q * math.sin(attitude.roll) + r * math.cos(attitude.roll)
            self.yaw_rate = turn / math.cos(attitude.pitch)

    def at(self, time: float, now: float) -> Floats:
        """Return the row of a measurement of a time [s] that arrives now [s]."""
        is_old = np.abs(now - self._came) > LONGEST_GAP  # or the clock was set back
        is_old[STEERING] = False
        row = np.where(is_old, np.nan, self._row)
        row[TIME] = time
        return row

    def take_odometry(self, message: Any, time: float, now: float, frame: str = "") -> Floats:
        """Take a pose; return the row of its time [s].

        Args:
            message: The odometry.
            time: Its time [s].
            now: Time of its arrival [s].
            frame: Frame that it must be in; empty takes every frame.

        Raises:
            MessageError: It has no pose that is possible, or is in another frame.
        """
        pose, _ = odometry_to_pose(message, frame or message.header.frame_id)
        columns = [X, Y, YAW] if self._has_imu else [X, Y, YAW, ROLL, PITCH]
        self._row[columns] = pose[[0, 1, 5, 3, 4]][: len(columns)]
        self._came[columns] = now
        return self.at(time, now)
