# SPDX-License-Identifier: Apache-2.0
"""Reads a recorded drive from a bag, as the rows that the ground is learned from."""

import contextlib
from pathlib import Path

import numpy as np

from msg_adapters.errors import MessageError
from msg_adapters.stamps import NANOSECONDS
from rover_physics.files.validation import show_file
from rover_physics.numerics.arrays import Floats
from rover_planner.errors import PlanningError
from rover_planner.learning.drive_log import WIDTH, check_rows
from rover_planner.ros.bags.bag_files import IMU, JOINTS, ODOMETRY, open_bag
from rover_planner.ros.row_collector import RowCollector


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
            time = (recorded.stamp - begin) / NANOSECONDS
            with contextlib.suppress(MessageError):
                if recorded.kind == JOINTS:
                    collector.take_joints(recorded.message, time)
                elif recorded.kind == IMU:
                    collector.take_imu(recorded.message, time)
                elif recorded.kind == ODOMETRY:
                    rows.append(collector.take_odometry(recorded.message, time, time))
    return check_rows(np.array(rows).reshape(-1, WIDTH), str(show_file(path)))
