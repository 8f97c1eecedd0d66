# SPDX-License-Identifier: Apache-2.0
"""Reads odometry messages: pose and its standard deviation; writes that of a planar odometry."""

import math
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from numpy.typing import NDArray

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame, read_orientation
from msg_adapters.sensing import odometry_message
from rover_physics.numerics.quaternions import xyzw_from_yaw

MAX_COORDINATE = 1e8
"""Largest coordinate of a pose [m]; UTM has 1e7."""
MAX_DEVIATION = 1e8
"""Largest standard deviation of a pose [m]."""
UNKNOWN = 1e6
"""Variance of what is not measured."""
YAW_RATE_VARIANCE = 1e-4
"""Variance of a yaw rate of an IMU [rad^2/s^2]."""


def odometry_to_pose(
    odometry: Odometry, map_frame: str, base_frame: str = ""
) -> tuple[NDArray[np.float64], float]:
    """Return the pose of the body, and the standard deviation of x, y [m].

    The pose is x, y, z [m], roll, pitch, yaw [rad] (6,).

    Args:
        odometry: The message.
        map_frame: Frame that its pose must be in.
        base_frame: Frame of the body; the message must have it or none as child_frame_id. Empty
            takes every child frame.

    Raises:
        MessageError: Another frame, values that are not finite or impossible, or no unit
            quaternion.
    """
    check_frame(odometry.header.frame_id, map_frame, "odometry")
    child = odometry.child_frame_id
    if base_frame and child not in ("", base_frame):
        raise MessageError(f"odometry is of frame {child!r}; it must be of {base_frame!r}")
    place = odometry.pose.pose.position
    angles = read_orientation(odometry.pose.pose.orientation, "odometry orientation")
    pose = np.array([place.x, place.y, place.z, *angles])
    variances = [float(odometry.pose.covariance[index]) for index in (0, 7)]
    possible = all(abs(one) <= MAX_COORDINATE for one in (place.x, place.y, place.z))
    if not possible or not all(variance <= MAX_DEVIATION**2 for variance in variances):
        raise MessageError(
            f"odometry has pose {pose.tolist()} and variances {variances}; coordinates must be "
            f"within {MAX_COORDINATE:g} m, variances within {MAX_DEVIATION**2:g} m^2"
        )
    return pose, math.sqrt(max(*variances, 0.0))


def planar_odometry(
    pose: NDArray[np.float64],
    covariance: NDArray[np.float64],
    speed: tuple[float, float],
    yaw_rate: float,
    frame_id: str,
    stamp: Any,
) -> Odometry:
    """Return the odometry of a rover that measures its way in the plane.

    Args:
        pose: (3,) x, y [m] and yaw [rad].
        covariance: (3, 3) of the pose.
        speed: Speed ahead and its standard deviation [m/s].
        yaw_rate: Rate of the yaw [rad/s].
        frame_id: Frame of the pose.
        stamp: builtin_interfaces/Time.
    """
    measured, unknown = [0, 1, 5], np.full(6, UNKNOWN)
    whole = np.diag(unknown)
    whole[np.ix_(measured, measured)] = covariance
    unknown[measured] = speed[1] ** 2, speed[1] ** 2, YAW_RATE_VARIANCE
    return odometry_message(
        np.array([pose[0], pose[1], 0.0]),
        np.array(xyzw_from_yaw(float(pose[2]))),
        np.array([speed[0], 0.0, 0.0]),
        np.array([0.0, 0.0, yaw_rate]),
        (whole, np.diag(unknown)),
        frame_id,
        stamp,
    )
