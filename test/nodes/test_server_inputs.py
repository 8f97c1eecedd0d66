# SPDX-License-Identifier: Apache-2.0
"""Messages of other frames, origins and sensors reach the service as what they are of the body."""

import time

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion
from sensor_msgs.msg import Imu, JointState

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import poses_path
from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.frames import Frames
from rover_planner.ros.server_inputs import LOOK_PERIOD, ServerInputs
from support.grounds import make_terrain, raised, waves
from support.messages import grid_map_of, odometry_at, transform_message
from support.rovers import LSR1

PRIOR = make_terrain(waves)


def inputs_with(*edges, clock=time.monotonic, **parameters) -> ServerInputs:
    """Return the inputs of a server that knows transforms (parent, child, where)."""
    values = TraverseServerParameters(**parameters)
    frames = Frames(values, lambda: 0)
    for edge in edges:
        frames.take_transform(transform_message(*edge, Time()), is_static=True)
    return ServerInputs(values, frames, clock)


def test_a_path_on_the_map_is_one_in_odom_and_of_the_body_where_the_robot_has_another_origin():
    map_odom = Rigid.from_rpy(30.0, -12.0, 0.4, 0.0, 0.0, 2.2)
    poses = [(x, 0.0, 0.3) for x in (-1.0, 0.0, 1.0)]
    there = [map_odom.then(Rigid.from_rpy(x, y, 0.0, 0.0, 0.0, yaw)).xyyaw for x, y, yaw in poses]
    inputs = inputs_with(("map", "odom", map_odom), map_frame="odom")
    np.testing.assert_allclose(inputs.read_path(poses_path(there, "map")).poses, poses, atol=1e-9)
    inputs = inputs_with(base_offset=(0.3, 0.0, 0.25, 0.0, 0.0, 0.0))
    ahead = poses_path([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], "map")
    np.testing.assert_allclose(inputs.read_path(ahead).poses[:, 0], (0.3, 1.3), atol=1e-9)
    inputs.take_odometry(odometry_at((1.0, 0.0, np.pi / 2)))
    np.testing.assert_allclose(inputs.service.fresh_pose(), (1.0, 0.3, np.pi / 2), atol=1e-9)


def test_layers_of_a_grid_map_of_a_sensor_are_used_and_placed_by_its_mount_and_odometry():
    inputs = inputs_with(
        sensor_mounts=("scanner:0.0:0.0:0.5:0.0:0.0:0.0",), elevation_layer="height",
        variance_layer="none", friction_layer="mu",
    )  # fmt: skip
    ones = np.ones(PRIOR.elevation.shape)
    layers = {"height": PRIOR.elevation, "variance": 4.0 * ones, "mu": 0.3 * ones}
    message = grid_map_of(layers, PRIOR.resolution, basic=("height",), start=(5, 3))
    message.header.frame_id = "scanner"
    inputs.take_odometry(odometry_at((2.0, -1.0, 0.0)))
    source = inputs.frames.find_source("scanner", None, "elevation_map")
    assert inputs.take_map(message, source, "elevation_map")
    found = inputs.service.terrain
    assert found.origin == pytest.approx(np.add(PRIOR.origin, (2.0, -1.0)))
    np.testing.assert_allclose(found.elevation, PRIOR.elevation + 0.5, atol=1e-6)
    assert found.elevation_std is None and found.friction.max() == pytest.approx(0.3)


def test_roll_and_pitch_of_the_standing_rover_are_those_of_the_imu():
    inputs = inputs_with(imu_attitude=True)
    inputs.take_joints(JointState(name=list(SUSPENSION_JOINTS), position=[0.0] * 4))
    inputs.take_odometry(odometry_at((0.0, 0.0, 0.3), height=0.3))
    x, y, z, w = xyzw_from_rpy(0.1, -0.2, 1.0).tolist()
    inputs.take_imu(Imu(orientation=Quaternion(x=x, y=y, z=z, w=w)))
    now = inputs.service.standing()
    assert now.pose[3:] == pytest.approx((0.1, -0.2, 0.3))


def test_odometry_whose_stamp_stands_still_gets_old():
    now = [0.0]
    inputs = inputs_with(clock=lambda: now[0])
    odometry = odometry_at((1.0, 2.0, 0.3))
    odometry.header.stamp = Time(sec=5)
    for now[0] in (0.0, 0.9, 1.8):
        inputs.take_odometry(odometry)
    assert inputs.find_here() is None
    odometry.header.stamp = Time(sec=4)
    inputs.take_odometry(odometry)
    np.testing.assert_allclose(inputs.find_here(), (1.0, 2.0, 0.3))


def test_ground_under_a_rover_is_filled_once_where_it_stands_and_again_where_it_crept_to():
    now = [0.0]
    inputs = inputs_with(clock=lambda: now[0])
    inputs.keep(inputs.keeper.load(PRIOR, 0.0, None), "prior")

    def may_fill(x: float) -> bool:
        now[0] += LOOK_PERIOD
        inputs.take_joints(JointState(name=list(SUSPENSION_JOINTS), position=[0.0] * 4))
        inputs.take_odometry(odometry_at((x, 0.0, 0.0)))
        return inputs.may_fill_under_rover()

    assert [may_fill(x) for x in (0.0, 0.0, 0.001, 0.0015, 0.003)] == [True, *3 * [False], True]
    inputs.keep(inputs.keeper.load(make_terrain(waves, half=3.0), 0.0, None), "another")
    assert may_fill(0.003) and not may_fill(0.003)


def test_a_map_that_is_published_again_stays_as_it_was_filled_under_a_rover_that_trembles():
    inputs = inputs_with(clock=lambda: 0.0)
    unseen = raised(PRIOR, np.s_[70:90, 70:90], np.nan)

    def take(height: float, second: int) -> bool:
        inputs.take_joints(JointState(name=list(SUSPENSION_JOINTS), position=[0.0] * 4))
        inputs.take_odometry(odometry_at((0.0, 0.0, 0.0), height=height))
        cloud = terrain_to_point_cloud(unseen, "map", Time(sec=second))
        return inputs.take_map(cloud, None, "elevation_cloud")

    assert take(0.3, 1)
    before = inputs.service.terrain
    assert np.isfinite(before.elevation).sum() > np.isfinite(unseen.elevation).sum()
    assert not take(0.3001, 2) and inputs.service.terrain is before
    assert inputs.service.known_map.stamp == 2e9
    inputs.keeper.apply(LSR1, TraverseServerParameters(fill_under_rover=False))
    assert take(0.3001, 3) and np.isnan(inputs.service.terrain.elevation).any()
