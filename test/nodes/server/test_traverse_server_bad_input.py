# SPDX-License-Identifier: Apache-2.0
"""Bad input of every kind is refused with a reason and a log line, and the node lives on."""

import json

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import PointCloud2

from msg_adapters.paths import poses_path, stamped_pose
from rover_physics import save_terrain
from support.grounds import make_terrain, waves
from support.planner_client import GOAL, START, verdict_of


def assert_refused(client, code, text, question):
    plan, results = client.next_results(question)
    verdict = verdict_of(results["verdict"])
    assert plan.poses == [] and plan.header.frame_id == "map"
    assert verdict["code"] == code and text in verdict["reason"], verdict
    status = results["verdict"].status[0]
    assert status.level == DiagnosticStatus.ERROR and text in status.message
    client.wait_for_log(f"can_traverse: refused ({code}): {verdict['reason']}")


def test_a_question_before_any_map_is_refused(server, client):
    missing = "elevation_cloud or call ~/load_map"
    assert_refused(client, "no_map", missing, lambda: client.can_traverse(START, GOAL))


def test_an_answer_of_which_no_messages_can_be_made_is_refused(shared, monkeypatch):
    server, publish, told = shared.server, shared.server.publish, []

    def publish_refusals(judgement, identity):
        told.append(judgement.code)
        if not judgement.code:
            raise MemoryError
        return publish(judgement, identity)

    monkeypatch.setattr(server, "publish", publish_refusals)
    answer = shared.client.check_poses(server, [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    assert not answer.success and json.loads(answer.message)["code"] == "internal_error"
    assert told == ["", "internal_error"]


def test_bad_requests_maps_and_paths_are_refused_with_their_reason_and_the_node_lives_on(shared):
    server, client = shared.server, shared.client
    before = server.service.known_map.fingerprint
    goal = stamped_pose(GOAL, "map")
    for start, text in (
        (stamped_pose(START, "odom"), "start is in frame 'odom'"),
        (PoseStamped(), "start is empty, which means where the rover is"),
        (stamped_pose(START, ""), "start is without a frame_id"),  # but is not empty
    ):
        assert_refused(client, "bad_request", text, lambda start=start: client.plan(start, goal))
    empty = PointCloud2()
    empty.header.frame_id = "map"
    client.send_cloud(empty)
    client.wait_for_log("the last good map stays: cloud has no points")
    assert client.check_poses(server, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]).success
    client.send_path(poses_path(np.zeros((2, 3)), "odom"))
    client.wait_for_log("path is in frame 'odom'")
    verdict = json.loads(client.check_path().message)  # not of the path before
    assert verdict["code"] == "no_path" and "path is in frame 'odom'" in verdict["reason"]
    client.send_path(poses_path(np.zeros((1501, 3)), "map"))
    client.wait_for_log("path has 1501 poses; it may have 1500")
    assert server.service.known_map.fingerprint == before
    assert client.can_traverse(START, GOAL).poses


def test_files_that_may_not_or_cannot_be_read_are_told_apart(shared, tmp_path):
    server, client = shared.server, shared.client
    before = server.service.known_map.fingerprint
    maps = tmp_path / "maps"
    maps.mkdir()
    save_terrain(maps / "large.npz", make_terrain(waves))
    (maps / "broken.npz").write_bytes(b"no archive")
    cells = server.service.terrain.elevation.size
    assert client.set_parameter("map_folder", str(maps)) == (True, "")
    assert client.set_parameter("max_map_cells", cells - 1) == (True, "")
    response = client.load_map(tmp_path / "outside.npz")
    assert response.result == response.RESULT_MAP_DOES_NOT_EXIST
    for name in ("broken.npz", "large.npz"):
        response = client.load_map(maps / name)
        assert response.result == response.RESULT_INVALID_MAP_DATA, name
    client.wait_for_log("the limit is")
    assert server.service.known_map.fingerprint == before
