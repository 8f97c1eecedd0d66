"""Poses, paths, odometry and tool messages of impossible numbers are refused by name."""

import math
import time

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from benchmarks.fuzz.hostile import HostileMaker
from msg_adapters.errors import MAX_TEXT, MessageError
from msg_adapters.frames import check_frame
from msg_adapters.imu import imu_to_attitude
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.paths import (
    MAX_POSES,
    decimate,
    path_to_poses,
    poses_path,
    stamped_pose,
    stamped_pose_to_array,
    yaw_from_quaternion,
)
from msg_adapters.tools import target_to_point, wrench_to_force_and_moment
from rover_physics.numerics.quaternions import length_of
from support.messages.tool_messages import make_target, make_wrench

HUGE = (1.1e9, 1e19, 1e154, 1e155, 1e200, 1e300, 1.7e308, math.inf, math.nan)


@pytest.mark.parametrize("huge", [1e155, 1e200, 1.7e308])
@pytest.mark.parametrize("element", "xyzw")
def test_a_huge_quaternion_is_refused_and_does_not_overflow(huge, element):
    turn = Quaternion()
    setattr(turn, element, huge)
    with pytest.raises(MessageError, match=r"has length 1(\.7)?e\+\d+; it must be"):
        yaw_from_quaternion(turn)
    odometry, imu = Odometry(), Imu()
    odometry.header.frame_id = "map"
    odometry.pose.pose.orientation = imu.orientation = turn
    with pytest.raises(MessageError, match="norm 1"):
        odometry_to_pose(odometry, "map")
    with pytest.raises(MessageError, match="norm 1"):
        imu_to_attitude(imu)


def test_the_length_of_a_quaternion_never_overflows():
    assert length_of((3e200, 0.0, 4e200, 0.0)) == pytest.approx(5e200)
    assert length_of((1.7e308, 1.7e308, 0.0, 0.0)) == math.inf
    assert length_of((3e-200, 0.0, 4e-200, 0.0)) == pytest.approx(5e-200)
    assert math.isnan(length_of((math.nan, 0.0, 0.0, 1.0)))


@pytest.mark.parametrize("huge", HUGE)
def test_a_position_beyond_any_map_is_refused(huge):
    for x, y in ((huge, 0.0), (0.0, -huge)):
        pose = stamped_pose((0.0, 0.0, 0.0), "map")
        pose.pose.position.x, pose.pose.position.y = x, y
        with pytest.raises(MessageError, match=r"finite, in metres, within 1e\+09"):
            stamped_pose_to_array(pose, "map", "goal")
    path = poses_path(np.zeros((3, 3)), "map")
    path.poses[2].pose.position.x = huge
    with pytest.raises(MessageError, match=r"path pose 2 has position x .* within 1e\+09"):
        path_to_poses(path, "map")


@pytest.mark.parametrize("huge", HUGE)
def test_a_target_or_a_load_beyond_any_arm_is_refused(huge):
    with pytest.raises(MessageError, match=r"tool target is .* within 1e\+09"):
        target_to_point(make_target(z=huge), "map")
    with pytest.raises(MessageError, match=r"tool wrench force is .* within 1e\+09"):
        wrench_to_force_and_moment(make_wrench(force=(huge, 0.0, 0.0)), "map")
    with pytest.raises(MessageError, match=r"tool wrench torque is .* within 1e\+09"):
        wrench_to_force_and_moment(make_wrench(moment=(0.0, -huge, 0.0)), "map")


def test_a_path_of_too_many_poses_is_refused_before_it_is_read():
    path = poses_path(np.zeros((1, 3)), "map")
    path.poses = path.poses * (MAX_POSES + 1)
    began = time.perf_counter()
    with pytest.raises(MessageError, match=r"path has 100001 poses; it may have 100000: leave"):
        path_to_poses(path, "map")
    assert time.perf_counter() - began < 5.0


@pytest.mark.parametrize("spacing", [1e-9, 1e-300, 5e-324])
def test_a_plan_of_the_finest_spacing_keeps_every_pose(spacing):
    poses = np.column_stack([np.linspace(0.0, 3.0, 151), np.zeros(151)])
    np.testing.assert_array_equal(decimate(poses, spacing), np.arange(151))


def test_an_endless_frame_does_not_make_an_endless_error():
    with pytest.raises(MessageError) as raised:
        check_frame("f" * 1_000_000, "map", "goal")
    assert len(str(raised.value)) <= MAX_TEXT and str(raised.value).startswith("goal is in frame")


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_every_hostile_pose_is_read_or_refused(seed):
    maker = HostileMaker(seed)
    for kind, read in (
        ("path", lambda path: path_to_poses(path, "map")),
        ("odometry", lambda odometry: odometry_to_pose(odometry, "map")[0]),
        ("tool_target", lambda target: target_to_point(target, "map")),
        ("tool_wrench", lambda wrench: np.array(wrench_to_force_and_moment(wrench, "map"))),
    ):
        try:
            assert np.isfinite(read(maker.make(kind))).all()
        except MessageError as error:
            assert len(str(error)) <= MAX_TEXT
