# SPDX-License-Identifier: Apache-2.0
"""Poses keep place and heading through messages; those without meaning are refused by name."""

import hashlib
import math
import struct

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message

from msg_adapters.errors import MAX_TEXT, MessageError
from msg_adapters.identity import path_hash, plan_request_hash
from msg_adapters.paths import (
    MAX_POSES,
    count_poses,
    decimate,
    path_to_poses,
    pose_to_array,
    poses_path,
    stamped_pose,
    yaw_from_quaternion,
)
from rover_physics.numerics.quaternions import xyzw_from_rpy
from support.messages import set_field


@pytest.mark.parametrize("yaw", [-3.0, -math.pi / 2, 0.0, 2.5])
def test_place_and_heading_survive_a_message(yaw):
    poses = np.array([[1.5, -2.5, yaw], [1.0, 0.1, 0.2]])
    alone = pose_to_array(stamped_pose(poses[0], "map").pose)
    np.testing.assert_allclose(alone, poses[0], atol=1e-15)
    np.testing.assert_allclose(path_to_poses(poses_path(poses, "map"), "map"), poses, atol=1e-15)


def test_the_heading_of_a_tilted_body_is_its_yaw():
    for roll, pitch, yaw in np.random.default_rng(2).uniform(-1.2, 1.2, (20, 3)):
        x, y, z, w = xyzw_from_rpy(roll, pitch, yaw).tolist()
        assert yaw_from_quaternion(Quaternion(x=x, y=y, z=z, w=w)) == pytest.approx(yaw)
    assert yaw_from_quaternion(Quaternion(z=0.707, w=0.707)) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("quaternion", "text"),
    [
        ((0.0, 0.0, 0.0, 0.0), "has length 0; it must be a quaternion of length 1"),
        ((0.0, 0.0, 0.0, 1.008), "has length 1.01; it must be"),
        ((0.0, math.nan, 0.0, 1.0), "is not finite"),
        ((0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5)), "it has no heading"),
        ((1e155, 0.0, 0.0, 0.0), r"has length 1e\+155; it must be"),
    ],
)
def test_a_bad_quaternion_is_refused(quaternion, text):
    x, y, z, w = quaternion
    with pytest.raises(MessageError, match=text):
        yaw_from_quaternion(Quaternion(x=x, y=y, z=z, w=w), "goal orientation")


def spoilt(field, value):
    """Return a path with a field of its third pose set to a value."""
    path = poses_path(np.zeros((4, 3)), "map")
    set_field(path, f"poses.2.{field}", value)
    return path


def path_of(count, frame="map"):
    path = poses_path(np.zeros((1, 3)), frame)
    path.poses = path.poses * count
    return path


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: poses_path([], "map"), "path has no poses"),
        (lambda: poses_path([[0.0, 0.0, 0.0]], "odom"), "path is in frame 'odom'"),
        (lambda: spoilt("header.frame_id", "base_link"), "path pose 2 is in frame 'base_link'"),
        (lambda: spoilt("pose.orientation.w", 0.0), r"path pose 2 orientation .* has length 0"),
        (lambda: spoilt("pose.position.x", math.nan), r"path pose 2 has position x .* within 1e"),
        (lambda: path_of(MAX_POSES + 1), r"path has 100001 poses; it may have 100000: leave"),
    ],
)
def test_a_path_is_refused_by_its_bad_part(make, text):
    with pytest.raises(MessageError, match=text):
        path_to_poses(make(), "map")


@given(numbers=st.lists(st.floats(), min_size=7, max_size=7))
def test_every_pose_is_read_or_refused(numbers):
    path = poses_path(np.zeros((2, 3)), "map")
    place, turn = path.poses[1].pose.position, path.poses[1].pose.orientation
    place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = numbers
    try:
        assert np.isfinite(path_to_poses(path, "map")).all()
    except MessageError as error:
        assert len(str(error)) <= MAX_TEXT


def test_decimation_keeps_the_ends_the_spacing_and_what_it_is_told_to():
    poses = np.column_stack([np.linspace(0.0, 3.0, 151), np.zeros((151, 2))])
    rows = decimate(poses, 0.1)
    assert rows[0] == 0 and rows[-1] == 150
    np.testing.assert_allclose(np.diff(poses[rows, 0]), 0.1, atol=1e-12)
    for spacing in (0.0, 1e-9, 5e-324):
        np.testing.assert_array_equal(decimate(poses, spacing), np.arange(151))
    np.testing.assert_array_equal(decimate(poses, 100.0), [0, 150])
    np.testing.assert_array_equal(decimate(poses[:1], 0.1), [0])
    np.testing.assert_array_equal(decimate(poses, 1.0, [7, 8, 7]), [0, 7, 8, 50, 100, 150])
    np.testing.assert_array_equal(decimate(np.zeros((5, 3)), 0.1), [0, 4])  # stands still


POSES = [(0.0, 0.0, 0.0), (1.0, 0.5, 0.3)]


def seven(pose):
    p, q = pose.position, pose.orientation
    return struct.pack("<7d", p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def test_the_hash_is_the_documented_one_and_stamps_do_not_count():
    path = poses_path(POSES, "map")
    data = b"map\0" + b"".join(seven(stamped.pose) for stamped in path.poses)
    for stamped in (path, *path.poses):
        stamped.header.stamp = Time(sec=5)
    assert path_hash(path) == hashlib.sha256(data).hexdigest()[:16]
    assert path_hash(poses_path([], "odom")) == hashlib.sha256(b"odom\0").hexdigest()[:16]
    start, goal = path.poses
    on_wire = struct.unpack("<f", struct.pack("<f", 0.1))[0]
    data = b"map\0map\0" + seven(start.pose) + seven(goal.pose) + struct.pack("<d", on_wire)
    for tolerance in (0.1, on_wire):
        found = plan_request_hash(start, goal, tolerance)
        assert found == hashlib.sha256(data).hexdigest()[:16]


@pytest.mark.parametrize("frame", ["", "map", "odom", "rover_1/map"])
def test_the_poses_of_a_path_are_counted_without_reading_it(frame):
    for count in (0, 1, 300):
        assert count_poses(serialize_message(path_of(count, frame))) == count
    with pytest.raises(MessageError, match="7 bytes were received that are no Path"):
        count_poses(b"\0\1\0\0map")
