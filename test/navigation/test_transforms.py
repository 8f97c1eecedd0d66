# SPDX-License-Identifier: Apache-2.0
"""Transforms are those of their time; a sensor is at its mount on the robot of that time."""

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from msg_adapters.stamps import ns_to_stamp
from rover_planner.errors import PlanningError
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.transforms import (
    Rigid,
    TransformError,
    TransformTree,
    read_mounts,
)
from rover_planner.ros.frames import Frames
from support.messages import transform_message

SECOND = 1_000_000_000
NOW = 1000 * SECOND
MAP_ODOM = Rigid.from_rpy(10.0, -4.0, 0.3, 0.02, -0.01, 1.2)
ODOM_BASE = Rigid.from_rpy(2.0, 1.0, 0.1, 0.0, 0.1, -0.4)
BASE_CAMERA = Rigid.from_rpy(0.3, 0.0, 0.5, 0.0, 0.6, 0.0)


def matrix(rigid):
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = rigid.rotation.as_matrix(), rigid.translation
    return whole


@pytest.fixture
def tree():
    tree = TransformTree(0.5)
    tree.take("map", "odom", NOW, MAP_ODOM)
    tree.take("odom", "base_link", NOW, ODOM_BASE)
    tree.take("base_link", "camera", 5, BASE_CAMERA, is_static=True)
    return tree


def test_chains_up_and_down_are_products_of_their_matrices(tree):
    whole = matrix(MAP_ODOM) @ matrix(ODOM_BASE) @ matrix(BASE_CAMERA)
    np.testing.assert_allclose(matrix(tree.find("map", "camera", None, NOW)), whole, atol=1e-12)
    back = tree.find("camera", "map", None, NOW)
    np.testing.assert_allclose(matrix(back) @ whole, np.eye(4), atol=1e-12)
    tree.take("base_link", "wheel", 7, ODOM_BASE, is_static=True)
    side = np.linalg.inv(matrix(BASE_CAMERA)) @ matrix(ODOM_BASE)
    found = matrix(tree.find("camera", "wheel", None, NOW + 9 * SECOND))
    np.testing.assert_allclose(found, side, atol=1e-12)  # static ones never age
    assert matrix(tree.find("odom", "odom", None, NOW)).tolist() == np.eye(4).tolist()


def test_a_stale_transform_is_refused_with_its_age(tree):
    tree.find("map", "base_link", None, NOW + SECOND // 2)
    stale = r"'base_link' to 'odom' is stale: it is 0\.700 s old"
    with pytest.raises(TransformError, match=stale):
        tree.find("map", "base_link", None, NOW + 7 * SECOND // 10)
    with pytest.raises(TransformError, match=r"0\.600 s old, transform_timeout is 0\.5 s"):
        tree.find("map", "base_link", NOW + 6 * SECOND // 10, NOW)
    with pytest.raises(TransformError, match=r"1\.000 s before the oldest"):
        tree.find("map", "base_link", NOW - SECOND, NOW)


def test_a_transform_from_before_the_clock_was_set_back_is_not_taken_as_fresh(tree):
    tree.find("map", "base_link", None, NOW - SECOND)  # dated ahead, as localisation does
    with pytest.raises(TransformError, match=r"is 980\.0 s in the future; check the clocks"):
        tree.find("map", "base_link", None, 20 * SECOND)


def test_frames_without_a_connection_or_in_a_circle_are_refused(tree):
    with pytest.raises(TransformError, match="no transforms connect the frames 'moon' and 'map'"):
        tree.find("map", "moon", None, NOW)
    assert tree.knows("map") and tree.knows("camera") and not tree.knows("moon")
    tree.take("camera", "map", NOW, MAP_ODOM)
    with pytest.raises(TransformError, match="circle"):
        tree.find("map", "camera", None, NOW)


def test_old_transforms_are_dropped_and_a_clock_set_back_starts_anew(tree):
    for k in range(400):
        tree.take("map", "odom", NOW + k * SECOND // 10, MAP_ODOM)
    with pytest.raises(TransformError, match="before the oldest"):
        tree.find("map", "odom", NOW + SECOND, NOW + 40 * SECOND)
    tree.take("map", "odom", NOW + 35 * SECOND, ODOM_BASE)
    found = tree.find("map", "odom", None, NOW + 35 * SECOND)
    np.testing.assert_allclose(found.translation, ODOM_BASE.translation)


MOUNT = Rigid.from_rpy(0.3, 0.1, 0.4, 0.0, 0.5, -0.2)
ENTRY = "front_camera:0.3:0.1:0.4:0.0:0.5:-0.2"
HERE, THERE = (1.0, 2.0, 0.3, 0.02, 0.05, 0.7), (1.1, 2.0, 0.3, 0.02, 0.05, 0.9)


class World:
    """What a server hears of its robot and its sensors."""

    def __init__(self):
        self.now = 0
        parameters = TraverseServerParameters(sensor_mounts=(ENTRY,))
        self.frames = Frames(parameters, lambda: self.now)

    def drive(self, robot: Rigid, stamp: int) -> None:
        """Have odometry say where the robot is."""
        odometry = Odometry(header=Header(frame_id="map", stamp=ns_to_stamp(stamp)))
        pose = odometry.pose.pose
        pose.position.x, pose.position.y, pose.position.z = robot.translation.tolist()
        turn = pose.orientation
        turn.x, turn.y, turn.z, turn.w = robot.rotation.as_quat().tolist()
        self.frames.take_odometry(odometry)

    def tell(self, parent: str, child: str, stamp: int, rigid: Rigid, is_static=False) -> None:
        """Have /tf say where a frame is."""
        message = transform_message(parent, child, rigid, ns_to_stamp(stamp))
        self.frames.take_transform(message, is_static=is_static)

    def find(self, frame: str, stamp: int | None, now: int) -> Rigid:
        self.now = now
        return self.frames.find(frame, stamp)


def assert_same(one: Rigid, other: Rigid) -> None:
    np.testing.assert_allclose(matrix(one), matrix(other), atol=1e-9)


def test_odometry_and_the_mount_tell_where_a_sensor_was_at_the_stamp():
    world = World()
    world.drive(Rigid.from_rpy(*HERE), 10 * SECOND)
    world.drive(Rigid.from_rpy(*THERE), 11 * SECOND)
    then = world.find("front_camera", 10 * SECOND + SECOND // 2, 11 * SECOND)
    halfway = Rigid.from_rpy(1.05, *HERE[1:5], 0.8)
    assert_same(then, halfway.then(MOUNT))
    newest = world.find("front_camera", None, 11 * SECOND)
    assert_same(newest, Rigid.from_rpy(*THERE).then(MOUNT))
    robot = world.find("base_link", None, 11 * SECOND)
    assert_same(robot, Rigid.from_rpy(*THERE))


def test_tf_comes_before_odometry_and_knows_further_mounts():
    world = World()
    world.drive(Rigid.from_rpy(*THERE), 10 * SECOND)
    on_mast = Rigid.from_rpy(0.0, 0.0, 1.2, 0.0, 0.3, 0.0)
    world.tell("base_link", "mast", 0, on_mast, is_static=True)
    by_odometry = world.find("mast", 10 * SECOND, 10 * SECOND)
    assert_same(by_odometry, Rigid.from_rpy(*THERE).then(on_mast))
    world.tell("map", "base_link", 10 * SECOND, Rigid.from_rpy(*HERE))
    for frame, mount in (("mast", on_mast), ("front_camera", MOUNT)):
        found = world.find(frame, 10 * SECOND, 10 * SECOND)
        assert_same(found, Rigid.from_rpy(*HERE).then(mount))


def test_clouds_beside_the_robot_need_no_robot_and_tf_off_the_map_leaves_it_to_odometry():
    world = World()
    survey = Rigid.from_rpy(30, -12, 0, 0, 0, 2.2)
    world.tell("survey", "map", 10 * SECOND, survey.inverse())
    assert_same(world.find("survey", 10 * SECOND, 10 * SECOND), survey)
    world.tell("odom", "base_link", 10 * SECOND, Rigid.from_rpy(*THERE))
    world.drive(Rigid.from_rpy(*HERE), 10 * SECOND)
    found = world.find("front_camera", 10 * SECOND, 10 * SECOND)
    assert_same(found, Rigid.from_rpy(*HERE).then(MOUNT))


def test_what_is_stale_or_missing_is_refused_with_its_age():
    world = World()
    with pytest.raises(TransformError, match="neither /tf nor odometry says where 'base_link'"):
        world.find("front_camera", None, SECOND)
    world.drive(Rigid.from_rpy(*HERE), 10 * SECOND)
    with pytest.raises(TransformError, match=r"by odometry: .* is stale: it is 3.000 s old"):
        world.find("front_camera", 12 * SECOND, 13 * SECOND)
    world.frames.apply_timeout(5.0)
    assert_same(
        world.find("front_camera", 12 * SECOND, 13 * SECOND), Rigid.from_rpy(*HERE).then(MOUNT)
    )
    with pytest.raises(TransformError, match=r"is in frame 'moon'; it must be in 'map', or"):
        world.find("moon", None, SECOND)


@pytest.mark.parametrize(
    "entry",
    ["camera:1:2:3", ":0:0:0:0:0:0", "c:0:0:x:0:0:0", "c:0:0:200:0:0:0", "c:0:0:0:nan:0:0"],
)  # fmt: skip
def test_a_wrong_mount_is_refused_with_its_form(entry):
    with pytest.raises(PlanningError, match=r"sensor_mounts has .* it must be frame:x:y:z:roll"):
        read_mounts([entry])
    with pytest.raises(PlanningError, match="has the frame 'front_camera' twice"):
        read_mounts([ENTRY, ENTRY])
