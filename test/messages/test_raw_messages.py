# SPDX-License-Identifier: Apache-2.0
"""Messages read from their bytes have the fields that rclpy finds in them."""

import math

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState, PointCloud2, PointField

from msg_adapters.errors import MessageError
from msg_adapters.raw_messages import SensorReader

STAMP = Time(sec=7, nanosec=8)


def imu() -> Imu:
    """Return an IMU message whose numbers all differ."""
    message = Imu()
    turn, rate = message.orientation, message.angular_velocity
    turn.x, turn.y, turn.z, turn.w, rate.x, rate.y, rate.z = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, math.nan
    message.orientation_covariance[:] = range(9)
    message.angular_velocity_covariance[:] = -1.0
    return message


def odometry(child: str) -> Odometry:
    """Return an odometry of a frame whose numbers all differ."""
    message = Odometry(child_frame_id=child)
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = (float(k) for k in range(7))
    message.pose.covariance[:] = range(36)
    return message


def twist() -> TwistStamped:
    """Return a command whose numbers all differ."""
    message = TwistStamped()
    for part, first in ((message.twist.linear, 1.0), (message.twist.angular, 4.0)):
        part.x, part.y, part.z = first, first + 1.0, first + 2.0
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
        imu(),
        odometry(""),
        odometry("base"),
        twist(),
        cloud(),
        JointState(),
        JointState(name=["a"], position=[1.0]),
        JointState(name=["a", "bcdefg"], velocity=[2.0, math.inf], effort=[3.0, 4.0]),
        JointState(name=["wheel", "", "räd"], position=[1.0, 2.0, 3.0], effort=[4.0, 5.0, 6.0]),
    ],
)
def test_fields_are_those_that_rclpy_reads(message, frame):
    message.header.frame_id, message.header.stamp = frame, STAMP
    read = SensorReader().read(serialize_message(message), type(message))
    assert repr(fields_of(read, read)) == repr(fields_of(message, read))
    assert (read.header.frame_id, read.header.stamp.nanosec) == (frame, 8)


def test_a_command_without_header_has_the_same_fields():
    plain = SensorReader().read(serialize_message(twist().twist), Twist)
    assert plain == SensorReader().read(serialize_message(twist()), TwistStamped).twist


@pytest.mark.parametrize(
    ("message", "lengths"),
    [(JointState(name=["wheel"], position=[1.0]), (0, 20, 40)), (cloud(), (0, 60, -9))],
)
def test_damaged_bytes_are_refused(message, lengths):
    kind, whole = type(message), serialize_message(message)
    for length in lengths:
        with pytest.raises(MessageError, match=f"no {kind.__name__}"):
            SensorReader().read(whole[:length], kind)


def test_the_data_of_a_cloud_are_read_where_they_are():
    message = serialize_message(cloud())
    assert SensorReader().read(message, PointCloud2).data.obj is message


def test_the_joints_of_several_publishers_keep_their_names():
    reader = SensorReader()
    for names in (["a", "b"], ["c"], [], ["a", "b"], ["a", "b"]):
        message = JointState(name=names, position=[0.5] * len(names))
        read = reader.read(serialize_message(message), JointState)
        assert (list(read.name), list(read.position)) == (names, [0.5] * len(names))
