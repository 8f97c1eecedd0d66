"""Poses keep place and heading through messages, and poses without meaning are refused."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Quaternion
from nav_msgs.msg import Path

from msg_adapters.errors import MessageError
from msg_adapters.paths import (
    decimate,
    path_to_poses,
    poses_path,
    stamped_pose,
    stamped_pose_to_array,
    yaw_from_quaternion,
)
from rover_physics.numerics.quaternions import xyzw_from_rpy


@pytest.mark.parametrize("yaw", [-3.0, -math.pi / 2, 0.0, 0.3, 2.5])
def test_place_and_heading_survive_a_message(yaw):
    pose = stamped_pose((1.5, -2.5, yaw), "map")
    np.testing.assert_allclose(stamped_pose_to_array(pose, "map"), [1.5, -2.5, yaw], atol=1e-15)


def test_a_path_survives_a_message():
    poses = np.array([[0.0, 0.0, 0.1], [1.0, 0.1, 0.2], [2.0, 0.3, -3.1]])
    np.testing.assert_allclose(path_to_poses(poses_path(poses, "map"), "map"), poses, atol=1e-15)


def test_the_heading_of_a_tilted_body_is_its_yaw():
    for roll, pitch, yaw in np.random.default_rng(2).uniform(-1.2, 1.2, (20, 3)):
        x, y, z, w = xyzw_from_rpy(roll, pitch, yaw).tolist()
        assert yaw_from_quaternion(Quaternion(x=x, y=y, z=z, w=w)) == pytest.approx(yaw)


@pytest.mark.parametrize(
    ("quaternion", "text"),
    [
        ((0.0, 0.0, 0.0, 0.0), "has length 0; it must be a quaternion of length 1"),
        ((0.0, 0.0, 1.0, 1.0), "has length 1.41"),
        ((0.0, 0.0, 0.0, 0.9), "has length 0.9"),
        ((0.0, math.nan, 0.0, 1.0), "is not finite"),
        ((0.0, 0.0, math.inf, 1.0), "is not finite"),
        ((0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5)), "it has no heading"),
    ],
)
def test_a_bad_quaternion_is_refused(quaternion, text):
    x, y, z, w = quaternion
    with pytest.raises(MessageError, match=text):
        yaw_from_quaternion(Quaternion(x=x, y=y, z=z, w=w), "goal orientation")


def test_a_quaternion_rounded_to_three_digits_is_accepted():
    assert yaw_from_quaternion(Quaternion(z=0.707, w=0.707)) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(("x", "y"), [(math.nan, 0.0), (0.0, math.inf)])
def test_a_position_that_is_not_finite_is_refused(x, y):
    pose = stamped_pose((0.0, 0.0, 0.0), "map")
    pose.pose.position.x, pose.pose.position.y = x, y
    with pytest.raises(MessageError, match=r"goal has position x .* both must be finite"):
        stamped_pose_to_array(pose, "map", "goal")


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        ("odom", "goal is in frame 'odom'; it must be in 'map'"),
        ("", "goal is without a frame_id; it must be in 'map'"),
    ],
)
def test_another_frame_is_refused(frame, text):
    with pytest.raises(MessageError, match=text):
        stamped_pose_to_array(stamped_pose((0.0, 0.0, 0.0), frame), "map", "goal")


def test_a_path_is_refused_by_its_bad_part():
    with pytest.raises(MessageError, match="path has no poses"):
        path_to_poses(poses_path([], "map"), "map")
    with pytest.raises(MessageError, match="path is in frame 'odom'"):
        path_to_poses(poses_path([[0.0, 0.0, 0.0]], "odom"), "map")
    path = poses_path(np.zeros((4, 3)), "map")
    path.poses[2].header.frame_id = "base_link"
    with pytest.raises(MessageError, match="path pose 2 is in frame 'base_link'"):
        path_to_poses(path, "map")
    path = poses_path(np.zeros((4, 3)), "map")
    path.poses[3].pose.orientation.w = 0.0
    with pytest.raises(MessageError, match=r"path pose 3 orientation .* has length 0"):
        path_to_poses(path, "map")


def test_poses_of_a_path_may_leave_their_frame_empty():
    path = Path(poses=[PoseStamped()])
    path.header.frame_id = "map"
    np.testing.assert_array_equal(path_to_poses(path, "map"), np.zeros((1, 3)))


def test_decimation_keeps_the_ends_and_the_spacing():
    poses = np.column_stack([np.linspace(0.0, 3.0, 151), np.zeros(151)])
    rows = decimate(poses, 0.1)
    assert rows[0] == 0 and rows[-1] == 150
    np.testing.assert_allclose(np.diff(poses[rows, 0]), 0.1, atol=1e-12)
    np.testing.assert_array_equal(decimate(poses, 0.0), np.arange(151))
    np.testing.assert_array_equal(decimate(poses, 100.0), [0, 150])
    np.testing.assert_array_equal(decimate(poses[:1], 0.1), [0])


def test_decimation_keeps_what_it_is_told_to():
    poses = np.column_stack([np.linspace(0.0, 1.0, 51), np.zeros(51)])
    np.testing.assert_array_equal(decimate(poses, 0.5, [7, 25, 8]), [0, 7, 8, 25, 50])


def test_decimation_copes_with_standing_still():
    np.testing.assert_array_equal(decimate(np.zeros((5, 3)), 0.1), [0, 4])
