"""Reads IMU messages: the attitude and angular velocity of the body."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Imu

from msg_adapters.errors import MessageError
from rover_physics.numerics.quaternions import length_of, rpy_from_xyzw

NOT_MEASURED = -1.0
"""First element of a covariance in sensor_msgs/Imu if the quantity is not measured."""


@dataclass(frozen=True, eq=False)
class Attitude:
    """Attitude of the body, measured by an IMU whose axes are those of the body."""

    roll: float
    """[rad]"""
    pitch: float
    """Pitch [rad], positive with the nose down."""
    rates: NDArray[np.float64] | None
    """(3,) angular velocity, body frame [rad/s]; None if it is not measured."""


def imu_to_attitude(imu: Imu) -> Attitude:
    """Read attitude and angular velocity; the yaw of the orientation is ignored.

    Raises:
        MessageError: No orientation, no unit quaternion, or values that are not finite.
    """
    if imu.orientation_covariance[0] == NOT_MEASURED:
        raise MessageError(
            "imu has no orientation (orientation_covariance[0] is -1); roll and pitch are needed"
        )
    q = imu.orientation
    x, y, z, w = q.x, q.y, q.z, q.w
    norm = length_of((x, y, z, w))
    if not 0.99 < norm < 1.01:
        raise MessageError(
            f"imu has orientation {[x, y, z, w]} of norm {norm:g}; it must be a quaternion of "
            "norm 1"
        )
    roll, pitch, _ = rpy_from_xyzw((x, y, z, w), squared_norm=norm**2)
    if imu.angular_velocity_covariance[0] == NOT_MEASURED:
        return Attitude(roll, pitch, None)
    rate = imu.angular_velocity
    if not math.isfinite(rate.x + rate.y + rate.z):
        raise MessageError(
            f"imu has angular velocity {[rate.x, rate.y, rate.z]}; it must be finite, in rad/s"
        )
    return Attitude(roll, pitch, np.array([rate.x, rate.y, rate.z]))
