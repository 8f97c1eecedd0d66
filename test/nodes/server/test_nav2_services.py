# SPDX-License-Identifier: Apache-2.0
"""Nav2's questions: which poses of a path are not passable, and a path to a pose."""

from types import SimpleNamespace

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy import action
from rclpy.node import Node

from msg_adapters.paths import path_to_poses, poses_path, stamped_pose
from rover_planner.nodes import nav2_services
from rover_planner.nodes.nav2_services import Nav2Services
from support.grounds import make_terrain, wall_at, waves
from support.waiting import wait_until

COMPUTE_PATH_TO_POSE = {
    "NONE": 0,
    "UNKNOWN": 200,
    "INVALID_PLANNER": 201,
    "TF_ERROR": 202,
    "START_OUTSIDE_MAP": 203,
    "GOAL_OUTSIDE_MAP": 204,
    "START_OCCUPIED": 205,
    "GOAL_OCCUPIED": 206,
    "TIMEOUT": 207,
    "NO_VALID_PATH": 208,
}
"""Constants of the result of the action in Nav2 1.3.13, as its sources have them; 1.3.0 has the
same. Nav2 is not on PyPI."""


def make_services(server):
    """Return the services of a server; nav2_msgs is not on PyPI."""
    return Nav2Services(
        server, server.desk, server.read_path, server.read_question, server.publish
    )


def ask(server, poses):
    """Put a request to the handler of the service, as rclpy would."""
    replies, services = [], make_services(server)
    request, response = SimpleNamespace(path=poses_path(poses, "map")), SimpleNamespace()
    services.check(request, response, replies.append)
    wait_until(lambda: replies, "the reply")
    return replies[0]


def test_the_poses_of_a_path_that_are_not_passable_are_named(server):
    answer = ask(server, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])  # there is no map
    assert not answer.is_valid and answer.invalid_pose_indices == [0, 1]
    server.service.take_terrain(make_terrain(wall_at(0.5)))
    answer = ask(server, [(-2.0, 0.0, 0.0), (-1.5, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    assert answer.is_valid and answer.invalid_pose_indices == []
    poses = [(x, 0.0, 0.0) for x in np.arange(-2.0, 0.6, 0.25)]
    answer = ask(server, poses)
    assert not answer.is_valid and answer.invalid_pose_indices
    assert min(answer.invalid_pose_indices) > 4
    assert all(0 <= index < len(poses) for index in answer.invalid_pose_indices)
    answer = ask(server, np.tile(poses[0], (1501, 1)))  # too many to be judged
    assert not answer.is_valid and len(answer.invalid_pose_indices) == 1501


def test_the_action_is_remapped_by_its_name(ros, monkeypatch):
    names, kind = [], SimpleNamespace(Result=None)
    monkeypatch.setattr(
        nav2_services, "find_type", lambda name: ("action" in name and kind) or None
    )
    monkeypatch.setattr(
        action, "ActionServer", lambda _node, _kind, name, *_, **__: names.append(name)
    )
    rule = ["--ros-args", "-r", "~/compute_path_to_pose:=compute_path_to_pose"]
    node = ros.spin(Node("judge", namespace="/one", context=ros.context, cli_args=rule))
    Nav2Services(node, None, None, None, None)
    assert names == ["/one/compute_path_to_pose"]


class GoalHandle:
    """Stands for rclpy's ServerGoalHandle: it executes a goal by calling the server's callback."""

    def __init__(self, services, start, goal):
        self.request = SimpleNamespace(
            goal=stamped_pose(goal, "map"), start=PoseStamped(), use_start=start is not None
        )
        if start is not None:
            self.request.start = stamped_pose(start, "map")
        self.ends, self.result, self._services = [], None, services

    def execute(self):
        self.result = self._services.finish(self)

    def succeed(self):
        self.ends.append("succeeded")

    def abort(self):
        self.ends.append("aborted")


def compute(server, start, goal):
    """Hand a goal to the handlers of the action, as rclpy would."""
    services = make_services(server)
    services.make_result = lambda: SimpleNamespace(**COMPUTE_PATH_TO_POSE)
    handle = GoalHandle(services, start, goal)
    services.compute(handle)
    wait_until(lambda: handle.ends, "the end of the goal")
    return handle


def test_a_path_to_a_pose_is_the_plan_of_can_traverse_and_a_goal_without_one_has_a_code(
    start_server, client, lasting
):
    server, start, goal = start_server(planner="fan"), (-1.0, 0.0, 0.0), (1.0, 0.2, 0.0)
    assert compute(server, start, goal).result.error_code == 200  # no map
    server.service.take_terrain(make_terrain(waves))
    assert compute(server, None, goal).result.error_code == 200  # nobody knows where it is
    assert compute(server, start, (99.0, 0.0, 0.0)).result.error_code == 204
    assert compute(server, (99.0, 0.0, 0.0), goal).result.error_code == 203
    plan = path_to_poses(client.can_traverse(start, goal), "map")
    handle = compute(server, start, goal)
    assert handle.ends == ["succeeded"] and handle.result.error_code == 0
    np.testing.assert_array_equal(path_to_poses(handle.result.path, "map"), plan)
    client.send_odometry(start)
    wait_until(lambda: server.service.fresh_pose() is not None, "odometry")
    here = compute(server, None, goal)
    np.testing.assert_allclose(path_to_poses(here.result.path, "map"), plan, atol=1e-9)
    server.service.take_terrain(make_terrain(wall_at(0.5)))
    handle = compute(server, start, (1.5, 0.0, 0.0))
    assert handle.ends == ["aborted"] and handle.result.error_code == 208
    assert handle.result.path.poses == []
