# SPDX-License-Identifier: Apache-2.0
"""Reads sensor messages from their bytes, without a Python object for each of their fields.

rclpy makes some twenty objects of an odometry, which takes several times as long as all that is
done with it, and copies the data of a cloud. Here a message has only the fields that adapters
read, under the same names, and the data of a cloud are a view of its bytes.
"""

import struct
from collections import namedtuple
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, PointCloud2

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


class Fields:
    """Reads the fields of a serialised message (CDR) one after the other.

    Where the message ends early, struct.error is raised.
    """

    def __init__(self, message: bytes):
        """Begin behind the first four bytes, which tell the order of the others."""
        self._message, self._order = message, "<" if message[1:2] == b"\1" else ">"
        self.at = 4
        """Where the next field begins, before its alignment."""

    def numbers(self, form: str) -> tuple[Any, ...]:
        """Return numbers of one size in a format of struct, such as "iI" or "4d"."""
        form = self._order + form
        self.at += (4 - self.at) % struct.calcsize(self._order + form[-1])
        found = struct.unpack_from(form, self._message, self.at)
        self.at += struct.calcsize(form)
        return found

    def count(self) -> int:
        """Return the number of elements of a sequence."""
        return int(self.numbers("I")[0])

    def text(self) -> str:
        """Return a text."""
        length = self.count()
        begin, self.at = self.at, self.at + length
        return self._message[begin : self.at - 1].decode(errors="replace")

    def view(self) -> memoryview:
        """Return a view of a sequence of bytes."""
        length = self.count()
        begin, self.at = self.at, self.at + length
        return memoryview(self._message)[begin : self.at]


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


READERS: dict[type, Callable[[Fields], SimpleNamespace]] = {
    Imu: _read_imu, Odometry: _read_odometry, PointCloud2: _read_cloud,
    Twist: _read_twist, TwistStamped: _read_twist_stamped,
}  # fmt: skip
"""What reads the messages of each type of this file."""


def read_raw(message: bytes, kind: type) -> Any:
    """Return what adapters read of a message of a type of READERS.

    Raises:
        MessageError: The bytes are no such message.
    """
    try:
        return READERS[kind](Fields(message))
    except struct.error as error:
        raise DamagedMessageError(message, kind, error) from None
