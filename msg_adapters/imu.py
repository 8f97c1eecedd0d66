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
from rover_physics.numerics.quaternions import matrix_from_xyzw, rpy_from_xyzw, xyzw_from_rpy

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
        self._is_turned = any(rpy)
        turn = xyzw_from_rpy(*rpy)
        self._matrix = matrix_from_xyzw(turn)
        self._body_in_imu = tuple((turn * (-1.0, -1.0, -1.0, 1.0)).tolist())

    def check_frame(self, frame_id: str) -> None:
        """Check the frame of a message.

        Raises:
            MessageError: It is another frame than that of the IMU.
        """
        if frame_id not in ("", self.frame_id):
            raise MessageError(
                f"imu is in frame {frame_id!r}; it must be in {self.frame_id!r}, or the "
                "parameters imu_frame and imu_mounting must tell how it is mounted"
            )

    def turn_orientation(self, xyzw: tuple[float, ...]) -> tuple[float, ...]:
        """Return the orientation of the body from that of the IMU, quaternions x, y, z, w."""
        if not self._is_turned:
            return xyzw
        ax, ay, az, aw = xyzw
        bx, by, bz, bw = self._body_in_imu
        return (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        )

    def turn_rates(self, rates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return angular velocities (3,) in the body frame from those in the IMU's frame."""
        return self._matrix @ rates if self._is_turned else rates


def imu_to_attitude(imu: Imu, mounting: ImuMounting | None = None) -> Attitude:
    """Read attitude and angular velocity; the yaw of the orientation is ignored.

    Args:
        imu: The message.
        mounting: Frame and mounting of the IMU; None takes every frame as that of the body.

    Raises:
        MessageError: Another frame, no orientation, no unit quaternion, or values that are not
            finite.
    """
    if mounting is not None:
        mounting.check_frame(imu.header.frame_id)
    if imu.orientation_covariance[0] == NOT_MEASURED:
        raise MessageError(
            "imu has no orientation (orientation_covariance[0] is -1); roll and pitch are needed"
        )
    q = imu.orientation
    xyzw = (q.x, q.y, q.z, q.w)
    norm = check_norm(xyzw, "imu orientation")
    body = xyzw if mounting is None else mounting.turn_orientation(xyzw)
    roll, pitch, _ = rpy_from_xyzw(body, squared_norm=norm**2)
    if imu.angular_velocity_covariance[0] == NOT_MEASURED:
        return Attitude(roll, pitch, None)
    rate = imu.angular_velocity
    if not math.isfinite(rate.x + rate.y + rate.z):
        raise MessageError(
            f"imu has angular velocity {[rate.x, rate.y, rate.z]}; it must be finite, in rad/s"
        )
    rates = np.array([rate.x, rate.y, rate.z])
    return Attitude(roll, pitch, rates if mounting is None else mounting.turn_rates(rates))
