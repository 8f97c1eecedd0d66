# SPDX-License-Identifier: Apache-2.0
"""Reads IMU messages: the attitude and angular velocity of the body."""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Imu

from msg_adapters.cdr import Fields
from msg_adapters.errors import MessageError
from msg_adapters.frames import check_norm
from msg_adapters.stamps import stamp_to_ns
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


class ImuReading(NamedTuple):
    """What is read of an IMU message."""

    stamp: int
    """Header stamp [ns]."""
    frame: str
    """Frame of the header."""
    xyzw: tuple[float, ...]
    """Orientation, a quaternion."""
    rates: tuple[float, ...]
    """(3,) angular velocity [rad/s]."""
    variances: tuple[float, float]
    """First elements of the covariances of both."""


def read_imu(message: bytes) -> ImuReading:
    """Return what a serialised Imu says.

    Raises:
        MessageError: It is none.
    """
    fields = Fields(message)
    try:
        stamp, frame, values = fields.stamp(), fields.text(), fields.numbers("17d")
    except struct.error:
        raise MessageError(f"{len(message)} bytes were received that are no Imu") from None
    return ImuReading(stamp, frame, values[:4], values[13:16], (values[4], values[16]))


def imu_to_attitude(imu: Imu, mounting: ImuMounting | None = None) -> Attitude:
    """Read attitude and angular velocity of a message; see `find_attitude`."""
    q, rate, header = imu.orientation, imu.angular_velocity, imu.header
    variances = imu.orientation_covariance[0], imu.angular_velocity_covariance[0]
    turn, rates = (q.x, q.y, q.z, q.w), (rate.x, rate.y, rate.z)
    stamp = stamp_to_ns(header.stamp) or 0
    return find_attitude(ImuReading(stamp, header.frame_id, turn, rates, variances), mounting)


def find_attitude(imu: ImuReading, mounting: ImuMounting | None = None) -> Attitude:
    """Return attitude and angular velocity; the yaw of the orientation is ignored.

    Args:
        imu: What was read of a message.
        mounting: Frame and mounting of the IMU; None takes every frame as that of the body.

    Raises:
        MessageError: Another frame, no orientation, no unit quaternion, or values that are not
            finite.
    """
    if mounting is not None:
        mounting.check_frame(imu.frame)
    if imu.variances[0] == NOT_MEASURED:
        raise MessageError(
            "imu has no orientation (orientation_covariance[0] is -1); roll and pitch are needed"
        )
    norm = check_norm(imu.xyzw, "imu")
    body = imu.xyzw if mounting is None else mounting.turn_orientation(imu.xyzw)
    roll, pitch, _ = rpy_from_xyzw(body, squared_norm=norm**2)
    if imu.variances[1] == NOT_MEASURED:
        return Attitude(roll, pitch, None)
    if not math.isfinite(sum(imu.rates)):
        raise MessageError(
            f"imu has angular velocity {list(imu.rates)}; it must be finite, in rad/s"
        )
    rates = np.array(imu.rates)
    return Attitude(roll, pitch, rates if mounting is None else mounting.turn_rates(rates))
