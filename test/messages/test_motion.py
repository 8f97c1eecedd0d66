# SPDX-License-Identifier: Apache-2.0
"""Attitude, odometry, commands, tool targets and wrenches: impossible ones are refused."""

import math
from functools import partial

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Imu

from msg_adapters.commands import target_to_point, twist_to_speeds, wrench_to_force_and_moment
from msg_adapters.errors import MessageError
from msg_adapters.frames import check_transform
from msg_adapters.sensors import ImuMounting, imu_to_attitude, odometry_to_pose
from rover_planner.planning.navigation.transforms import Rigid
from support.messages import make_target, make_wrench, odometry_at, transform_message

NAN, INF = math.nan, math.inf


def imu(xyzw=(0.0, 0.0, 0.0, 1.0), rates=(0.0, 0.0, 0.0), frame=""):
    message = Imu()
    message.header.frame_id = frame
    turn, turning = message.orientation, message.angular_velocity
    turn.x, turn.y, turn.z, turn.w = map(float, xyzw)
    turning.x, turning.y, turning.z = map(float, rates)
    return message


def odometry(child="base_link", variance=0.0, turn=0.0, y=0.0):
    message = odometry_at((0.0, y, 0.0))
    message.child_frame_id = child
    message.pose.pose.orientation.x = turn
    message.pose.covariance[7] = variance
    return message


@pytest.mark.parametrize("mounting", [(0.3, -0.2, 2.0), (math.pi, 0.0, 0.5), (0.0, 1.2, -1.0)])
def test_a_mounted_imu_gives_the_attitude_and_the_rates_of_the_body(mounting):
    body, mount = (Rigid.from_rpy(0.0, 0.0, 0.0, *rpy) for rpy in ((0.1, -0.25, 1.5), mounting))
    rates = np.array([0.2, -0.1, 0.4])
    measured = imu(body.then(mount).rotation.as_quat(), mount.rotation.inv().apply(rates), "mast")
    attitude = imu_to_attitude(measured, ImuMounting("mast", mounting))
    assert (attitude.roll, attitude.pitch) == pytest.approx((0.1, -0.25))
    assert attitude.rates == pytest.approx(rates)


def test_odometry_without_the_name_of_its_body_is_taken():
    assert odometry_to_pose(odometry(""), "map", "base_link")[1] == 0.0


read_imu = partial(imu_to_attitude, mounting=ImuMounting("base_link"))
read_odometry = partial(odometry_to_pose, map_frame="map", base_frame="base_link")
read_target = partial(target_to_point, map_frame="map")
read_wrench = partial(wrench_to_force_and_moment, map_frame="map")


def transform(x=0.0, length=1.0, child="odom"):
    message = transform_message("map", child, Rigid.none(), Time())
    message.transform.translation.x, message.transform.rotation.w = x, length
    return message


TRANSFORM = "must be finite, a quaternion of length 1, and both frames"
MAST = "in frame 'mast'.*imu_frame and imu_mounting"


@pytest.mark.parametrize(
    ("read", "message", "text"),
    [
        (read_imu, imu(frame="mast"), MAST),
        (read_imu, imu((1e155, 0.0, 0.0, 0.0)), "imu orientation .* has length"),
        (read_odometry, odometry(turn=1e155), "odometry orientation .* has length"),
        *[(read_odometry, odometry(y=y), "must be within 1e") for y in (-1e9, NAN)],
        *[(read_odometry, odometry(variance=v), "variances within") for v in (1e200, NAN)],
        (read_odometry, odometry("mast"), "is of frame 'mast'; it must be of 'base_li"),
        (check_transform, transform(x=NAN), TRANSFORM),
        (check_transform, transform(length=2.0), TRANSFORM),
        *[(check_transform, transform(child=child), TRANSFORM) for child in ("", "map")],
        (twist_to_speeds, Twist(linear=Vector3(x=NAN)), "both must be finite"),
        (read_target, make_target(frame="odom"), "tool target is in frame 'odom'"),
        (read_target, make_target(frame=""), "without a frame_id"),
        *[(read_target, make_target(z=z), r"target is .* within 1e\+09") for z in (1e10, NAN)],
        (read_wrench, make_wrench(frame="base_link"), "tool wrench is in frame 'base_link'"),
        (read_wrench, make_wrench(force=(0.0, INF, 0.0)), r"wrench force is .* within 1e\+09"),
        (read_wrench, make_wrench(moment=(0.0, -1e300, 0.0)), r"torque is .* within 1e\+09"),
    ],
)
def test_what_is_impossible_is_refused_by_name(read, message, text):
    with pytest.raises(MessageError, match=text):
        read(message)
