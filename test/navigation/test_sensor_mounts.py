# SPDX-License-Identifier: Apache-2.0
"""Where a sensor is: its mount on the robot, and the robot at the time of the measurement."""

import numpy as np
import pytest

from rover_planner.errors import PlanningError
from rover_planner.planning.navigation.sensor_mounts import SensorPoses, read_mounts
from rover_planner.planning.navigation.transforms import (
    Rigid,
    TransformError,
    TransformTree,
)

SECOND = 1_000_000_000
MOUNT = Rigid.from_rpy(0.3, 0.1, 0.4, 0.0, 0.5, -0.2)
ENTRY = "front_camera:0.3:0.1:0.4:0.0:0.5:-0.2"
HERE, THERE = (1.0, 2.0, 0.3, 0.02, 0.05, 0.7), (1.1, 2.0, 0.3, 0.02, 0.05, 0.7)


def poses_with(mounts=(ENTRY,)) -> SensorPoses:
    return SensorPoses(read_mounts(mounts), "map", "base_link", 0.5)


def assert_same(one: Rigid, other: Rigid) -> None:
    np.testing.assert_allclose(one.translation, other.translation, atol=1e-9)
    np.testing.assert_allclose(one.rotation.as_matrix(), other.rotation.as_matrix(), atol=1e-9)


def test_odometry_and_the_mount_tell_where_a_sensor_was_at_the_stamp():
    sensors, tree = poses_with(), TransformTree(0.5)
    sensors.take(Rigid.from_rpy(*HERE), 10 * SECOND)
    sensors.take(Rigid.from_rpy(*THERE), 11 * SECOND)
    then = sensors.find("front_camera", 10 * SECOND + SECOND // 2, 11 * SECOND, tree)
    halfway = Rigid.from_rpy(1.05, *HERE[1:])
    assert_same(then, halfway.then(MOUNT))
    newest = sensors.find("front_camera", None, 11 * SECOND, tree)
    assert_same(newest, Rigid.from_rpy(*THERE).then(MOUNT))
    robot = sensors.find("base_link", None, 11 * SECOND, tree)
    assert_same(robot, Rigid.from_rpy(*THERE))


def test_tf_comes_before_odometry_and_knows_further_mounts():
    sensors, tree = poses_with(), TransformTree(0.5)
    sensors.take(Rigid.from_rpy(*THERE), 10 * SECOND)
    on_mast = Rigid.from_rpy(0.0, 0.0, 1.2, 0.0, 0.3, 0.0)
    tree.take("base_link", "mast", 0, on_mast, is_static=True)
    by_odometry = sensors.find("mast", 10 * SECOND, 10 * SECOND, tree)
    assert_same(by_odometry, Rigid.from_rpy(*THERE).then(on_mast))
    tree.take("map", "base_link", 10 * SECOND, Rigid.from_rpy(*HERE))
    for frame, mount in (("mast", on_mast), ("front_camera", MOUNT)):
        found = sensors.find(frame, 10 * SECOND, 10 * SECOND, tree)
        assert_same(found, Rigid.from_rpy(*HERE).then(mount))


def test_clouds_beside_the_robot_need_no_robot_and_tf_off_the_map_leaves_it_to_odometry():
    sensors, tree, survey = poses_with(), TransformTree(0.5), Rigid.from_rpy(30, -12, 0, 0, 0, 2.2)
    tree.take("survey", "map", 10 * SECOND, survey.inverse())
    assert_same(sensors.find("survey", 10 * SECOND, 10 * SECOND, tree), survey)
    tree.take("odom", "base_link", 10 * SECOND, Rigid.from_rpy(*THERE))
    sensors.take(Rigid.from_rpy(*HERE), 10 * SECOND)
    found = sensors.find("front_camera", 10 * SECOND, 10 * SECOND, tree)
    assert_same(found, Rigid.from_rpy(*HERE).then(MOUNT))


def test_what_is_stale_or_missing_is_refused_with_its_age():
    sensors, tree = poses_with(), TransformTree(0.5)
    with pytest.raises(TransformError, match="neither /tf nor odometry says where 'base_link'"):
        sensors.find("front_camera", None, SECOND, tree)
    sensors.take(Rigid.from_rpy(*HERE), 10 * SECOND)
    with pytest.raises(TransformError, match=r"by odometry: .* is stale: it is 3.000 s old"):
        sensors.find("front_camera", 12 * SECOND, 13 * SECOND, tree)
    sensors.timeout = 5.0
    assert_same(
        sensors.find("front_camera", 12 * SECOND, 13 * SECOND, tree),
        Rigid.from_rpy(*HERE).then(MOUNT),
    )
    with pytest.raises(TransformError, match=r"is in frame 'moon'; it must be in 'map', or"):
        sensors.find("moon", None, SECOND, tree)


@pytest.mark.parametrize(
    "entry",
    ["camera:1:2:3", ":0:0:0:0:0:0", "c:0:0:x:0:0:0", "c:0:0:200:0:0:0", "c:0:0:0:nan:0:0"],
)  # fmt: skip
def test_a_wrong_mount_is_refused_with_its_form(entry):
    with pytest.raises(PlanningError, match=r"sensor_mounts has .* it must be frame:x:y:z:roll"):
        read_mounts([entry])
    with pytest.raises(PlanningError, match="has the frame 'front_camera' twice"):
        read_mounts([ENTRY, ENTRY])
