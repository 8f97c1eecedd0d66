# SPDX-License-Identifier: Apache-2.0
"""Questions in another frame, and from where the rover is."""

from functools import partial

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped

from msg_adapters.paths import path_to_poses, stamped_pose
from rover_planner.planning.navigation.transforms import Rigid
from support.grounds import make_terrain, rocky
from support.messages import send_transforms
from support.planner_client import GOAL, START, verdict_of
from support.waiting import wait_until

MAP_ODOM = Rigid.from_rpy(30.0, -12.0, 0.4, 0.0, 0.0, 2.2)
"""Where odometry began, on the map."""


def send(server, *edges, age=0.0, is_static=False):
    send_transforms(server, partial(server.frames.take, is_static=is_static), *edges, age=age)


def on_map(pose):
    """Return a pose (3,) in odom as a PoseStamped in the frame map."""
    level = Rigid.from_rpy(pose[0], pose[1], 0.0, 0.0, 0.0, pose[2])
    return stamped_pose(MAP_ODOM.then(level).xyyaw, "map")


@pytest.fixture
def in_odom(start_server):
    """Return a server whose map is in odom."""
    server = start_server(map_frame="odom", transform_timeout=30.0)
    server.service.take_terrain(make_terrain(rocky))
    return server


def test_a_goal_on_the_map_gets_the_answer_of_one_frame(in_odom, client):
    single, _ = client.next_results(lambda: client.can_traverse(START, GOAL, frame="odom"))
    send(in_odom, ("map", "odom", MAP_ODOM))
    both, _ = client.next_results(lambda: client.plan(on_map(START), on_map(GOAL)))
    assert single.poses and both.header.frame_id == "odom"
    one, other = path_to_poses(single, "odom"), path_to_poses(both, "odom")
    assert one.shape == other.shape
    assert np.abs(one - other)[:, :2].max() < 1e-3
    assert np.abs(one - other)[:, 2].max() < 1e-4
    mixed, _ = client.next_results(lambda: client.plan(stamped_pose(START, "odom"), on_map(GOAL)))
    assert np.abs(path_to_poses(mixed, "odom") - one)[:, :2].max() < 1e-3


def test_an_empty_start_is_where_odometry_says_the_rover_is(mapped, client, lasting):
    plan, results = client.next_results(
        lambda: client.plan(PoseStamped(), stamped_pose(GOAL, "map"))
    )
    assert "start is empty, which means where the rover is" in verdict_of(results)["reason"]
    client.send_odometry(START)
    wait_until(lambda: mapped.service.fresh_pose() is not None, "odometry")
    plan, _ = client.next_results(lambda: client.plan(PoseStamped(), stamped_pose(GOAL, "map")))
    np.testing.assert_allclose(path_to_poses(plan, "map")[0], START, atol=1e-9)
    nowhere = stamped_pose((1.0, 0.0, 0.0), "")  # has no frame, but is not empty
    _, results = client.next_results(lambda: client.plan(nowhere, stamped_pose(GOAL, "map")))
    assert "start is without a frame_id" in verdict_of(results)["reason"]
