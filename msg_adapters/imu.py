# SPDX-License-Identifier: Apache-2.0
"""Reads IMU messages: the attitude and angular velocity of the body."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Imu

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_norm
from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy

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


class ImuMounting:
    """Frame of an IMU and its turn against the body."""

    def __init__(self, frame_id: str, rpy: Sequence[float] = (0.0, 0.0, 0.0)):
        """Take the frame of the IMU, and roll, pitch, yaw of its axes in the body frame [rad]."""
        self.frame_id = frame_id
        """Frame that its messages must have; one without a frame_id is taken as well."""
        self._turn = matrix_from_xyzw(xyzw_from_rpy(*rpy)) if any(rpy) else None

    def turn(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a vector (3,) in the body frame from one in the IMU's frame."""
        return vector if self._turn is None else self._turn @ vector


def imu_to_attitude(imu: Imu, mounting: ImuMounting | None = None) -> Attitude:
    """Read attitude and angular velocity; the yaw of the orientation is ignored.

    Args:
        imu: The message.
        mounting: Frame and mounting of the IMU; None takes every frame as that of the body.

    Raises:
        MessageError: Another frame, no orientation, no unit quaternion, or values that are not
            finite.
    """
    frame = imu.header.frame_id
    if mounting is not None and frame not in ("", mounting.frame_id):
        raise MessageError(
            f"imu is in frame {frame!r}; it must be in {mounting.frame_id!r}, or the parameters "
            "imu_frame and imu_mounting must tell how it is mounted"
        )
    if imu.orientation_covariance[0] == NOT_MEASURED:
        raise MessageError(
            "imu has no orientation (orientation_covariance[0] is -1); roll and pitch are needed"
        )
    q = imu.orientation
    xyzw = (q.x, q.y, q.z, q.w)
    norm = check_norm(xyzw, "imu orientation")
    turn = (lambda vector: vector) if mounting is None else mounting.turn
    x, y, z = turn(matrix_from_xyzw(np.array(xyzw) / norm)[2]).tolist()  # upwards
    roll, pitch = math.atan2(y, z), -math.asin(max(-1.0, min(1.0, x)))
    if imu.angular_velocity_covariance[0] == NOT_MEASURED:
        return Attitude(roll, pitch, None)
    rate = imu.angular_velocity
    if not math.isfinite(rate.x + rate.y + rate.z):
        raise MessageError(
            f"imu has angular velocity {[rate.x, rate.y, rate.z]}; it must be finite, in rad/s"
        )
    return Attitude(roll, pitch, turn(np.array([rate.x, rate.y, rate.z])))
