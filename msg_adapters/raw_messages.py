# SPDX-License-Identifier: Apache-2.0
"""Reads sensor messages from their bytes, without a Python object for each of their fields.

rclpy makes some twenty objects of an odometry, which takes several times as long as all that is
done with it. Here a message has only the fields that adapters read, under the same names.
"""

import struct
from types import SimpleNamespace
from typing import Any, NamedTuple

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState

from msg_adapters.errors import MessageError

HEAD = 4
"""Bytes before the fields, which tell how these are written."""
LITTLE_ENDIAN = b"\x00\x01"
"""How they begin where fields are plain CDR, little-endian; others are left to rclpy."""


class _Vector(NamedTuple):
    x: float
    y: float
    z: float


class _Quaternion(NamedTuple):
    x: float
    y: float
    z: float
    w: float


class _Fields:
    """The fields of a message, read one by one."""

    def __init__(self, message: bytes):
        self._message, self._at = message, HEAD

    def integers(self, kinds: str) -> tuple[int, ...]:
        """Return the next integers of four bytes, of kinds of `struct`."""
        return self._unpack(kinds, 4)

    def numbers(self, count: int) -> tuple[float, ...]:
        """Return the next numbers of eight bytes."""
        return self._unpack(f"{count}d", 8) if count else ()

    def _unpack(self, kinds: str, size: int) -> tuple[Any, ...]:
        begin = self._at + (HEAD - self._at) % size
        self._at = begin + struct.calcsize(f"<{kinds}")
        return struct.unpack_from(f"<{kinds}", self._message, begin)

    def text(self) -> str:
        """Return the next text."""
        (length,) = self.integers("I")
        begin, self._at = self._at, self._at + length
        return self._message[begin : self._at].rstrip(b"\0").decode()

    def header(self) -> SimpleNamespace:
        """Return a std_msgs/Header."""
        seconds, nanoseconds = self.integers("iI")
        stamp = SimpleNamespace(sec=seconds, nanosec=nanoseconds)
        return SimpleNamespace(stamp=stamp, frame_id=self.text())


def read_sensor(message: bytes, kind: type) -> Any:
    """Return what adapters read of an Imu, JointState or Odometry.

    Raises:
        MessageError: The bytes are no such message.
    """
    try:
        if not message.startswith(LITTLE_ENDIAN):
            return deserialize_message(message, kind)
        return _READERS[kind](_Fields(message))
    except Exception as error:  # RMWError, of a module that differs between distributions
        raise MessageError(
            f"{len(message)} bytes were received that are no {kind.__name__}; the publisher or "
            f"the connection is damaged: {error}"
        ) from None


def _read_imu(fields: _Fields) -> SimpleNamespace:
    header, values = fields.header(), fields.numbers(25)
    return SimpleNamespace(
        header=header,
        orientation=_Quaternion(*values[:4]),
        orientation_covariance=values[4:13],
        angular_velocity=_Vector(*values[13:16]),
        angular_velocity_covariance=values[16:],
    )


def _read_joints(fields: _Fields) -> SimpleNamespace:
    header = fields.header()
    names = [fields.text() for _ in range(*fields.integers("I"))]
    position, velocity, effort = (fields.numbers(*fields.integers("I")) for _ in range(3))
    return SimpleNamespace(
        header=header, name=names, position=position, velocity=velocity, effort=effort
    )


def _read_odometry(fields: _Fields) -> SimpleNamespace:
    header, child, values = fields.header(), fields.text(), fields.numbers(43)
    pose = SimpleNamespace(position=_Vector(*values[:3]), orientation=_Quaternion(*values[3:7]))
    pose = SimpleNamespace(pose=pose, covariance=values[7:])
    return SimpleNamespace(header=header, child_frame_id=child, pose=pose)


_READERS = {Imu: _read_imu, JointState: _read_joints, Odometry: _read_odometry}
