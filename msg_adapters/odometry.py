"""Reads odometry messages: the rover's pose on the map and its standard deviation."""

import math

import numpy as np
from nav_msgs.msg import Odometry
from numpy.typing import NDArray

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from rover_physics.numerics.quaternions import length_of, rpy_from_xyzw


def odometry_to_pose(odometry: Odometry, map_frame: str) -> tuple[NDArray[np.float64], float]:
    """Return x, y, z [m], yaw [rad] (4,) of the body, and the standard deviation of x, y [m].

    Raises:
        MessageError: Another frame, values that are not finite, or no unit quaternion.
    """
    check_frame(odometry.header.frame_id, map_frame, "odometry")
    place, q = odometry.pose.pose.position, odometry.pose.pose.orientation
    norm = length_of((q.x, q.y, q.z, q.w))
    if not 0.99 < norm < 1.01:
        raise MessageError(
            f"odometry has orientation {[q.x, q.y, q.z, q.w]} of norm {norm:g}; it must be a "
            "quaternion of norm 1"
        )
    _, _, yaw = rpy_from_xyzw((q.x, q.y, q.z, q.w), squared_norm=norm**2)
    pose = np.array([place.x, place.y, place.z, yaw])
    covariance = odometry.pose.covariance
    variance = max(float(covariance[0]), float(covariance[7]), 0.0)
    if not (np.isfinite(pose).all() and math.isfinite(variance)):
        raise MessageError(
            f"odometry has pose {pose.tolist()} and variance {variance}; all must be finite"
        )
    return pose, math.sqrt(variance)
