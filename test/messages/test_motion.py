"""Attitude, odometry and commands: frames are looked at, impossible values are refused."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from msg_adapters.commands import twist_to_speeds
from msg_adapters.errors import MessageError
from msg_adapters.imu import ImuMounting, imu_to_attitude
from msg_adapters.odometry import odometry_to_pose
from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy


def imu(xyzw=(0.0, 0.0, 0.0, 1.0), rates=(0.0, 0.0, 0.0), frame=""):
    message = Imu()
    message.header.frame_id = frame
    turn, turning = message.orientation, message.angular_velocity
    turn.x, turn.y, turn.z, turn.w = map(float, xyzw)
    turning.x, turning.y, turning.z = map(float, rates)
    return message


def odometry(child="base_link", **position):
    message = Odometry(child_frame_id=child)
    message.header.frame_id = "map"
    for name, value in position.items():
        setattr(message.pose.pose.position, name, value)
    return message


@pytest.mark.parametrize("mounting", [(0.3, -0.2, 2.0), (math.pi, 0.0, 0.5), (0.0, 1.2, -1.0)])
def test_a_mounted_imu_gives_the_attitude_and_the_rates_of_the_body(mounting):
    body = matrix_from_xyzw(xyzw_from_rpy(0.1, -0.25, 1.5))
    imu_in_body = matrix_from_xyzw(xyzw_from_rpy(*mounting))
    measured = xyzw_from_matrix(body @ imu_in_body)
    rates = np.array([0.2, -0.1, 0.4])
    attitude = imu_to_attitude(
        imu(measured, imu_in_body.T @ rates, "imu_link"), ImuMounting("imu_link", mounting)
    )
    assert (attitude.roll, attitude.pitch) == pytest.approx((0.1, -0.25))
    assert attitude.rates == pytest.approx(rates)


def xyzw_from_matrix(R):
    """Return the quaternion of a rotation matrix, by its eigenvector of eigenvalue 1."""
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
            [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
            [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], 0],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
        ]
    )
    values, vectors = np.linalg.eigh(K / 3.0)
    return vectors[:, np.argmax(values)]


@pytest.mark.parametrize("frame", ["", "base_link"])
def test_an_imu_of_the_body_and_one_without_a_frame_are_taken(frame):
    given = imu(xyzw_from_rpy(0.1, 0.2, 0.0), frame=frame)
    assert imu_to_attitude(given, ImuMounting("base_link")).roll == pytest.approx(0.1)


def test_an_imu_in_another_frame_is_refused_with_the_parameters_that_mend_it():
    with pytest.raises(MessageError, match=r"in frame 'mast'.*imu_frame and imu_mounting"):
        imu_to_attitude(imu(frame="mast"), ImuMounting("base_link"))


@pytest.mark.parametrize("size", [1e155, 1e200, math.inf, math.nan])
def test_huge_orientations_are_refused(size):
    with pytest.raises(MessageError, match="imu has orientation"):
        imu_to_attitude(imu((size, 0.0, 0.0, 0.0)))
    message = odometry()
    message.pose.pose.orientation.x = size
    with pytest.raises(MessageError, match="odometry has orientation"):
        odometry_to_pose(message, "map")


@pytest.mark.parametrize("value", [1e200, -1e9, math.nan, math.inf])
def test_impossible_positions_are_refused(value):
    with pytest.raises(MessageError, match="coordinates must be within 1e"):
        odometry_to_pose(odometry(y=value), "map")


@pytest.mark.parametrize("index", [0, 7])
@pytest.mark.parametrize("value", [1e200, math.nan])
def test_impossible_variances_are_refused(index, value):
    message = odometry()
    message.pose.covariance[index] = value
    with pytest.raises(MessageError, match="variances within"):
        odometry_to_pose(message, "map")


def test_odometry_of_another_body_is_refused():
    assert odometry_to_pose(odometry(""), "map", "base_link")[1] == 0.0
    with pytest.raises(MessageError, match="odometry is of frame 'mast'; it must be of 'base_li"):
        odometry_to_pose(odometry("mast"), "map", "base_link")


@pytest.mark.parametrize("kind", [Twist, TwistStamped])
def test_both_kinds_of_twists_are_read(kind):
    message = kind()
    speeds = message.twist if kind is TwistStamped else message
    speeds.linear.x, speeds.angular.z = 0.1, -0.2
    assert twist_to_speeds(message) == (0.1, -0.2)
