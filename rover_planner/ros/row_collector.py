# SPDX-License-Identifier: Apache-2.0
"""Merges joint states, attitude and odometry into the rows that the ground is learned from."""

import math
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

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

_COLUMNS = (
    dict(zip(SUSPENSION_JOINTS, range(WIDTH)[SUSPENSION], strict=True))
    | dict(zip(STEERING_JOINTS, range(WIDTH)[STEERING], strict=True)),
    dict(zip(WHEEL_JOINTS, range(WIDTH)[RATES], strict=True)),
    dict(zip(WHEEL_JOINTS, range(WIDTH)[TORQUES], strict=True)),
)
"""Columns of positions, velocities and efforts by joint."""


@dataclass(frozen=True)
class _Selection:
    """The measurements among all values of joint states, and what becomes of them."""

    places: NDArray[np.intp]
    columns: NDArray[np.intp]
    signs: Floats
    offsets: Floats


class RowCollector:
    """Gives a row for each odometry, with what was measured last."""

    def __init__(self, names: JointNames = OWN_NAMES) -> None:
        """Start without measurements; `names` are those of the joints in messages."""
        self._row, self._names, self._has_imu = np.full(WIDTH, np.nan), names, False
        self._form: tuple[Any, ...] = ()
        self._chosen = self._select((), ())
        self._yaw_rate = math.nan

    def take_joints(self, message: Any) -> None:
        """Take joint states by name; a value that is missing or not finite was not measured."""
        fields = message.position, message.velocity, message.effort
        form = tuple(message.name), tuple(map(len, fields))
        if form != self._form:
            self._form, self._chosen = form, self._select(*form)
        chosen = self._chosen
        values = np.fromiter(chain(*fields), float)[chosen.places]
        measured = chosen.signs * values + chosen.offsets
        self._row[chosen.columns] = np.where(np.isfinite(measured), measured, np.nan)

    def _select(self, listed: tuple[str, ...], lengths: tuple[int, ...]) -> _Selection:
        """Return what is measured in messages with such names and lengths of their fields."""
        links = [self._names.link(self._names.model_name(name)) for name in listed]
        found, begin = [], 0
        for columns, length in zip(_COLUMNS, lengths, strict=False):
            for place, link in enumerate(links if length == len(listed) else ()):
                if link.model in columns:
                    offset = link.offset if columns is _COLUMNS[0] else 0.0
                    found.append((begin + place, columns[link.model], link.sign, offset))
            begin += length
        places, own_columns, signs, offsets = np.array(found).reshape(-1, 4).T
        return _Selection(places.astype(int), own_columns.astype(int), signs, offsets)

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
        rates, steering = row[RATES].copy(), row[STEERING].copy()
        if math.isnan(self._yaw_rate) or np.isnan(rates).all():
            return None
        steering[np.isnan(steering)] = 0.0
        return WheelMotion(time, rates, steering, row[ROLL], row[PITCH], self._yaw_rate)

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
