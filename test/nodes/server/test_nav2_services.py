# SPDX-License-Identifier: Apache-2.0
"""Nav2's questions: which poses of a path are not passable, and a path to a pose."""

from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy import action
from rclpy.node import Node

from msg_adapters.paths import path_to_poses, poses_path, stamped_pose
from rover_planner.nodes import nav2_services
from rover_planner.nodes.nav2_services import Nav2Services
from support.grounds import make_terrain, wall_at, waves
from support.waiting import wait_until

ERRORS = (
    "UNKNOWN", "INVALID_PLANNER", "TF_ERROR", "START_OUTSIDE_MAP", "GOAL_OUTSIDE_MAP",
    "START_OCCUPIED", "GOAL_OCCUPIED", "TIMEOUT", "NO_VALID_PATH",
)  # fmt: skip
COMPUTE_PATH_TO_POSE = {"NONE": 0} | {name: 200 + k for k, name in enumerate(ERRORS)}
"""Constants of the result of the action in Nav2 1.3.13, as its sources have them; 1.3.0 has the
same. Nav2 is not on PyPI."""


def make_services(server):
    """Return the services of a server; nav2_msgs is not on PyPI."""
    return Nav2Services(
        server, server.desk, server.read_path, server.read_question, server.publish
    )


def ask(server, poses):
    """Put a request to the handlers of the service, as the desk would."""
    answers, services = [], make_services(server)
    request, response = SimpleNamespace(path=poses_path(poses, "map")), SimpleNamespace()
    server.desk.ask("is_path_valid", server.read_path(request.path), answers.append)
    wait_until(lambda: answers, "the answer")
    services.fill(request, response, answers[0])
    return response


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


def compute(server, start, goal):
    """Hand a goal to the handlers of the action, as rclpy would; return handle and result."""
    services, results = make_services(server), []
    services.make_result = lambda: SimpleNamespace(**COMPUTE_PATH_TO_POSE)
    begin = PoseStamped() if start is None else stamped_pose(start, "map")
    end, uses_start = stamped_pose(goal, "map"), start is not None
    handle = Mock(request=SimpleNamespace(goal=end, start=begin, use_start=uses_start))
    handle.execute.side_effect = lambda: results.append(services.finish(handle))
    services.compute(handle)
    wait_until(lambda: results, "the end of the goal")
    return handle, results[0]


def code_of(server, start, goal):
    """Return the error code of a goal that is aborted."""
    handle, result = compute(server, start, goal)
    assert handle.abort.called and not handle.succeed.called and result.path.poses == []
    return result.error_code


def test_a_path_to_a_pose_is_the_plan_of_can_traverse_and_a_goal_without_one_has_a_code(
    start_server, client, lasting
):
    server, start, goal = start_server(planner="fan"), (-1.0, 0.0, 0.0), (1.0, 0.2, 0.0)
    assert code_of(server, start, goal) == 200  # no map
    server.service.take_terrain(make_terrain(waves))
    assert code_of(server, None, goal) == 200  # nobody knows where it is
    assert code_of(server, start, (99.0, 0.0, 0.0)) == 204
    assert code_of(server, (99.0, 0.0, 0.0), goal) == 203
    plan = path_to_poses(client.can_traverse(start, goal), "map")
    handle, result = compute(server, start, goal)
    assert handle.succeed.called and result.error_code == 0
    np.testing.assert_array_equal(path_to_poses(result.path, "map"), plan)
    client.stand(start)
    wait_until(lambda: server.service.fresh_pose() is not None, "odometry")
    _, result = compute(server, None, goal)
    np.testing.assert_allclose(path_to_poses(result.path, "map"), plan, atol=1e-9)
    by_the_edge = 0.0, 3.95, 0.5 * np.pi  # on the map, but wheels are not
    assert code_of(server, start, by_the_edge) == 208
    server.service.take_terrain(make_terrain(wall_at(0.5)))
    assert code_of(server, start, (1.5, 0.0, 0.0)) == 208
