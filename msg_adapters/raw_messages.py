# SPDX-License-Identifier: Apache-2.0
"""Reads sensor messages from their bytes, without a Python object for each of their fields.

rclpy makes some twenty objects of an odometry, which takes several times as long as all that is
done with it, and copies the data of a cloud. Here a message has only the fields that adapters
read, under the same names, and the data of a cloud are a view of its bytes.
"""

import struct
from collections import namedtuple
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState, PointCloud2

from msg_adapters.cdr import Fields
from msg_adapters.errors import MessageError

MAX_FIELDS = 1000
"""Largest number of fields of a cloud."""


class DamagedMessageError(MessageError):
    """Bytes that are no message of their type."""

    def __init__(self, message: bytes, kind: type, error: Exception):
        super().__init__(
            f"{len(message)} bytes were received that are no {kind.__name__}; the publisher or "
            f"the connection is damaged: {error}"
        )


_Vector = namedtuple("_Vector", "x y z")
_Quaternion = namedtuple("_Quaternion", "x y z w")


class SensorReader:
    """Reads messages of sensors.

    Frame and names of joints are read once: those of a publisher are the same in each message.
    """

    def __init__(self) -> None:
        self._readers = {
            Imu: _read_imu, JointState: self._read_joints, Odometry: _read_odometry,
            Twist: _read_twist, TwistStamped: _read_twist_stamped, PointCloud2: _read_cloud,
        }  # fmt: skip
        self._head, self._frame = b"", ""
        self._names: tuple[str, ...] = ()

    def reads(self, kind: type) -> bool:
        """Return whether it reads messages of a type."""
        return kind in self._readers

    def read(self, message: bytes, kind: type) -> Any:
        """Return what adapters read of a message of a type that it `reads`.

        Raises:
            MessageError: The bytes are no such message.
        """
        try:
            return self._readers[kind](Fields(message))
        except struct.error as error:
            raise DamagedMessageError(message, kind, error) from None

    def _read_joints(self, fields: Fields) -> SimpleNamespace:
        stamp = _read_stamp(fields)
        if not fields.skip(self._head):
            begin = fields.at
            self._frame = fields.text()
            self._names = tuple(fields.text() for _ in range(fields.count()))
            self._head = fields.since(begin)
        position, velocity, effort = (fields.doubles() for _ in range(3))
        return SimpleNamespace(
            header=SimpleNamespace(stamp=stamp, frame_id=self._frame), name=self._names,
            position=position, velocity=velocity, effort=effort,
        )  # fmt: skip


def _read_stamp(fields: Fields) -> SimpleNamespace:
    seconds, nanoseconds = fields.numbers("iI")
    return SimpleNamespace(sec=seconds, nanosec=nanoseconds)


def _read_header(fields: Fields) -> SimpleNamespace:
    return SimpleNamespace(stamp=_read_stamp(fields), frame_id=fields.text())


def _read_imu(fields: Fields) -> SimpleNamespace:
    header, values = _read_header(fields), fields.numbers("25d")
    return SimpleNamespace(
        header=header,
        orientation=_Quaternion(*values[:4]),
        orientation_covariance=values[4:13],
        angular_velocity=_Vector(*values[13:16]),
        angular_velocity_covariance=values[16:],
    )


def _read_odometry(fields: Fields) -> SimpleNamespace:
    header, child, values = _read_header(fields), fields.text(), fields.numbers("43d")
    pose = SimpleNamespace(position=_Vector(*values[:3]), orientation=_Quaternion(*values[3:7]))
    pose = SimpleNamespace(pose=pose, covariance=values[7:])
    return SimpleNamespace(header=header, child_frame_id=child, pose=pose)


def _read_twist(fields: Fields) -> SimpleNamespace:
    values = fields.numbers("6d")
    return SimpleNamespace(linear=_Vector(*values[:3]), angular=_Vector(*values[3:]))


def _read_twist_stamped(fields: Fields) -> SimpleNamespace:
    return SimpleNamespace(header=_read_header(fields), twist=_read_twist(fields))


def _read_cloud(fields: Fields) -> SimpleNamespace:
    header, (height, width) = _read_header(fields), fields.numbers("II")
    columns = [_read_point_field(fields) for _ in range(min(fields.count(), MAX_FIELDS))]
    (is_bigendian,), (point_step, row_step) = fields.numbers("B"), fields.numbers("II")
    data, (is_dense,) = fields.view(), fields.numbers("B")
    return SimpleNamespace(
        header=header, height=height, width=width, fields=columns, is_bigendian=bool(is_bigendian),
        point_step=point_step, row_step=row_step, data=data, is_dense=bool(is_dense),
    )  # fmt: skip


def _read_point_field(fields: Fields) -> SimpleNamespace:
    name, (offset,), (datatype,) = fields.text(), fields.numbers("I"), fields.numbers("B")
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=fields.count())
