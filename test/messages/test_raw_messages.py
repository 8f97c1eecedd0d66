# SPDX-License-Identifier: Apache-2.0
"""Messages read from their bytes have the fields that rclpy finds in them."""

import itertools

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, PointCloud2, PointField

from msg_adapters.errors import MessageError
from msg_adapters.raw_messages import read_raw

NUMBERS = itertools.count()


def filled(message):
    """Return a message whose floating-point numbers have been made to differ."""
    for name, kind in message.get_fields_and_field_types().items():
        if kind == "double":
            setattr(message, name, float(next(NUMBERS)))
        elif kind.startswith("double["):
            getattr(message, name)[:] = [next(NUMBERS) for _ in getattr(message, name)]
        elif "/" in kind:
            filled(getattr(message, name))
    return message


def cloud() -> PointCloud2:
    """Return a cloud of two points with two fields."""
    message = PointCloud2(height=1, width=2, point_step=12, row_step=24, is_dense=True)
    message.fields = [
        PointField(name=name, offset=offset, datatype=datatype, count=1)
        for name, offset, datatype in (("x", 0, PointField.FLOAT64), ("räd", 8, PointField.INT32))
    ]
    message.data = bytes(range(24))
    return message


def fields_of(message, like) -> object:
    """Return the fields of a message that `like` has, as plain values."""
    names = getattr(like, "_fields", getattr(like, "__dict__", ()))
    if names:
        return [fields_of(getattr(message, name), getattr(like, name)) for name in names]
    if isinstance(like, list):
        return [fields_of(one, other) for one, other in zip(message, like, strict=True)]
    if isinstance(like, memoryview):
        return bytes(message)
    if isinstance(like, tuple):
        return [one if isinstance(one, str) else float(one) for one in message]
    return message


@pytest.mark.parametrize("frame", ["", "map", "a long name of a frame"])
@pytest.mark.parametrize(
    "message",
    [
        filled(Imu()),
        filled(Odometry()),
        filled(Odometry(child_frame_id="base")),
        filled(TwistStamped()),
        cloud(),
    ],
)
def test_fields_are_those_that_rclpy_reads(message, frame):
    message.header.frame_id, message.header.stamp = frame, Time(sec=7, nanosec=8)
    read = read_raw(serialize_message(message), type(message))
    assert repr(fields_of(read, read)) == repr(fields_of(message, read))
    assert (read.header.frame_id, read.header.stamp.nanosec) == (frame, 8)


@pytest.mark.parametrize(("message", "lengths"), [(Imu(), (0, 20, 60)), (cloud(), (0, 60, -9))])
def test_damaged_bytes_are_refused(message, lengths):
    kind, whole = type(message), serialize_message(message)
    for length in lengths:
        with pytest.raises(MessageError, match=f"no {kind.__name__}"):
            read_raw(whole[:length], kind)
