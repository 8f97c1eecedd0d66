"""Nav2's question about a path gets the poses that are not passable."""

from types import SimpleNamespace

import numpy as np

from msg_adapters.paths import poses_path
from rover_planner.nodes.path_validity import PathValidity, find_invalid_poses
from rover_planner.planning.path_geometry import densify, next_given_poses
from support.grounds import make_terrain, wall_at, waves
from support.ros_fixtures import wait_until


def ask(server, poses):
    """Put a request to the handler of the service, as rclpy would; nav2_msgs is not on PyPI."""
    replies = []
    validity = PathValidity(server.desk, "map", server.publish)
    request, response = SimpleNamespace(path=poses_path(poses, "map")), SimpleNamespace()
    validity.take(request, response, replies.append)
    wait_until(lambda: replies, "the reply")
    return replies[0]


def test_a_passable_path_is_valid_and_has_no_bad_pose(server):
    server.service.take_terrain(make_terrain(waves))
    answer = ask(server, [(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    assert answer.is_valid and answer.invalid_pose_indices == []


def test_the_poses_behind_a_wall_are_named(server):
    server.service.take_terrain(make_terrain(wall_at(0.5)))
    poses = [(x, 0.0, 0.0) for x in np.arange(-2.0, 0.6, 0.25)]
    answer = ask(server, poses)
    assert not answer.is_valid and answer.invalid_pose_indices
    assert min(answer.invalid_pose_indices) > 4
    assert all(0 <= index < len(poses) for index in answer.invalid_pose_indices)


def test_a_path_that_cannot_be_judged_has_only_bad_poses(server):
    answer = ask(server, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])  # there is no map
    assert not answer.is_valid and answer.invalid_pose_indices == [0, 1]


def test_each_waypoint_knows_the_given_pose_at_or_after_it():
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.3, 1.0]])
    given = next_given_poses(poses, 0.1)
    dense = densify(poses, 0.1)
    assert len(given) == len(dense) and given[0] == 0 and given[-1] == 3
    places = [int(np.argmin(np.abs(dense - pose).sum(axis=1))) for pose in poses]
    np.testing.assert_array_equal(given[places], range(4))
    assert np.all(np.diff(given) >= 0)
    codes = [""] * len(given)
    codes[places[1] - 1] = "friction"
    assert find_invalid_poses(codes, given) == [1]
