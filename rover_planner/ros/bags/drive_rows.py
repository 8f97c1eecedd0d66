# SPDX-License-Identifier: Apache-2.0
"""Reads a recorded drive from a bag, as the rows that the ground is learned from."""

from pathlib import Path

import numpy as np

from msg_adapters.errors import MessageError
from msg_adapters.imu import imu_to_attitude
from msg_adapters.odometry import odometry_to_pose, odometry_to_tilt
from msg_adapters.stamps import NANOSECONDS
from rover_physics.files.validation import show_file
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_planner.errors import PlanningError
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
    check_rows,
)
from rover_planner.ros.bags.bag_reader import IMU, JOINTS, ODOMETRY, Recorded, open_bag

PLACES = {name: SUSPENSION.start + k for k, name in enumerate(SUSPENSION_JOINTS)} | {
    name: STEERING.start + k for k, name in enumerate(STEERING_JOINTS)
}
"""Columns of the angles of joints."""
RATE_PLACES = {name: RATES.start + k for k, name in enumerate(WHEEL_JOINTS)}
TORQUE_PLACES = {name: TORQUES.start + k for k, name in enumerate(WHEEL_JOINTS)}
"""Columns of rates and torques of the wheels."""


class RowCollector:
    """Merges messages into rows: a row for each odometry, with what was measured last."""

    def __init__(self) -> None:
        """Start without measurements."""
        self._row = np.full(WIDTH, np.nan)
        self._has_imu = False

    def take_joints(self, message: object) -> None:
        """Take joint states by name; a NaN or a missing value leaves the last one."""
        names = list(message.name)  # type: ignore[attr-defined]
        for values, places in (
            (message.position, PLACES),  # type: ignore[attr-defined]
            (message.velocity, RATE_PLACES),  # type: ignore[attr-defined]
            (message.effort, TORQUE_PLACES),  # type: ignore[attr-defined]
        ):
            if len(values) != len(names):
                continue
            for name, value in zip(names, values, strict=True):
                if name in places:
                    self._row[places[name]] = value if np.isfinite(value) else np.nan

    def take_imu(self, message: object) -> None:
        """Take roll and pitch.

        Raises:
            MessageError: It has no orientation.
        """
        attitude = imu_to_attitude(message)  # type: ignore[arg-type]
        self._row[[ROLL, PITCH]] = attitude.roll, attitude.pitch
        self._has_imu = True

    def take_odometry(self, message: object, time: float) -> Floats:
        """Take a pose; return the row of its time [s].

        Raises:
            MessageError: It has no pose that is possible.
        """
        frame = message.header.frame_id  # type: ignore[attr-defined]
        pose, _ = odometry_to_pose(message, frame)  # type: ignore[arg-type]
        self._row[TIME] = time
        self._row[[X, Y, YAW]] = pose[[0, 1, 3]]
        if not self._has_imu:
            self._row[[ROLL, PITCH]] = odometry_to_tilt(message)  # type: ignore[arg-type]
        return self._row.copy()


def read_rows(path: Path, odometry_topic: str) -> Floats:
    """Return the rows (n, WIDTH) of a bag; times are those of the recording, from 0.

    Args:
        path: The bag, with joint states and with odometry that does not come from the wheels, in
            the frame of the map.
        odometry_topic: Topic of this odometry; empty to choose.

    Raises:
        PlanningError: It cannot be read, or lacks joint states or odometry.
    """
    collector, rows, begin = RowCollector(), [], -1
    with open_bag(path, {ODOMETRY: odometry_topic}) as bag:
        for kind in (JOINTS, ODOMETRY):
            if kind not in bag.topics:
                raise PlanningError(f"{show_file(path)}: has no {kind}")
        for recorded in bag.messages():
            begin = recorded.stamp if begin < 0 else begin
            try:
                row = _take(collector, recorded, (recorded.stamp - begin) / NANOSECONDS)
            except MessageError:
                continue
            if row is not None:
                rows.append(row)
    return check_rows(np.array(rows).reshape(-1, WIDTH), str(show_file(path)))


def _take(collector: RowCollector, recorded: Recorded, time: float) -> Floats | None:
    if recorded.kind == JOINTS:
        collector.take_joints(recorded.message)
    elif recorded.kind == IMU:
        collector.take_imu(recorded.message)
    elif recorded.kind == ODOMETRY:
        return collector.take_odometry(recorded.message, time)
    return None
