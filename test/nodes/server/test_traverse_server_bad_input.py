# SPDX-License-Identifier: Apache-2.0
"""Bad input of every kind is refused with a reason and a log line, and the node lives on."""

import json
import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import poses_path, stamped_pose
from rover_physics.terrain.grid import save_terrain
from rover_planner.planning.answering.snapshot import Snapshot
from support.grounds import make_terrain, wall_at, waves
from support.planner_client import GOAL, START, ask, verdict_of
from support.waiting import wait_until


def assert_refused(client, code, text, question):
    plan, results = client.next_results(question)
    verdict = verdict_of(results)
    assert plan.poses == [] and plan.header.frame_id == "map"
    assert verdict["code"] == code and text in verdict["reason"], verdict
    status = results["verdict"].status[0]
    assert status.level == DiagnosticStatus.ERROR and text in status.message
    client.wait_for_log(f"can_traverse: refused ({code}): {verdict['reason']}")


def test_questions_before_any_map_or_path_are_refused_and_answered_after_it(server, client):
    missing = "elevation_cloud or call ~/load_map"
    assert_refused(client, "no_map", missing, lambda: client.can_traverse(START, GOAL))
    answer = client.check_path()
    assert not answer.success and json.loads(answer.message)["code"] == "no_path"
    answer = client.check_poses(server, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert not answer.success and json.loads(answer.message)["code"] == "no_map"
    client.send_terrain(make_terrain(waves))
    assert len(client.can_traverse(START, GOAL).poses) > 2


def refuse_requests(server, client, tmp_path):
    far, twisted = stamped_pose((math.nan, 0.0, 0.0), "map"), PoseStamped()
    twisted.header.frame_id, twisted.pose.orientation.w = "map", 0.0
    start, goal = stamped_pose(START, "map"), stamped_pose(GOAL, "map")
    for first, last, tolerance, text in [
        (start, stamped_pose(GOAL, "odom"), 0.0, "goal is in frame 'odom'"),
        (stamped_pose(START, ""), goal, 0.0, "start is without a frame_id"),
        (start, far, 0.0, "goal has position x nan"),
        (twisted, goal, 0.0, "start orientation (x 0, y 0, z 0, w 0) has length 0"),
        (start, goal, -0.5, "tolerance is -0.5"),
        (start, goal, math.inf, "tolerance is inf"),
        (start, stamped_pose((1e9, 0.0, 0.0), "map"), 0.0, "waypoints"),
    ]:
        assert_refused(
            client, "bad_request", text, lambda s=first, g=last, t=tolerance: client.plan(s, g, t)
        )


def refuse_clouds(server, client, tmp_path):
    other_frame = terrain_to_point_cloud(make_terrain(wall_at(0.5)), "odom")
    for cloud, text in [
        (other_frame, "it must be in 'map'"),
        (PointCloud2(header=terrain_to_point_cloud(make_terrain(waves), "map").header),
         "the last good map stays: cloud has no points"),
    ]:  # fmt: skip
        client.send_cloud(cloud)
        client.wait_for_log(text)


def refuse_paths(server, client, tmp_path):
    assert client.check_poses(server, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]).success
    twisted = poses_path(np.zeros((3, 3)), "map")
    twisted.poses[1].pose.orientation.w = 0.0
    for path, text in [
        (poses_path(np.zeros((2, 3)), "odom"), "path is in frame 'odom'"),
        (poses_path([], "map"), "path has no poses"),
        (twisted, "path pose 1 orientation"),
    ]:
        client.send_path(path)
        client.wait_for_log(text)
        verdict = json.loads(client.check_path().message)  # not of the path before
        assert verdict["code"] == "no_path" and text in verdict["reason"]
    endless = client.check_poses(server, [[0.0, 0.0, 0.0], [1e8, 0.0, 0.0]])
    verdict = json.loads(endless.message)
    assert verdict["code"] == "bad_request" and "1e+08 m long" in verdict["reason"]


def refuse_files(server, client, tmp_path):
    maps = tmp_path / "maps"
    maps.mkdir()
    for file in (tmp_path / "outside.npz", maps / "large.npz"):
        save_terrain(file, make_terrain(waves))
    (maps / "out.npz").symlink_to(tmp_path / "outside.npz")
    (maps / "broken.npz").write_bytes(b"no archive")
    np.savez(maps / "flat.npz", elevation=np.zeros((3, 3)), resolution=0.0, origin=(0.0, 0.0))
    cells = server.service.terrain.elevation.size
    assert client.set_parameter("map_folder", str(maps)) == (True, "")
    assert client.set_parameter("max_map_cells", cells - 1) == (True, "")
    nowhere = [maps / "none.npz", maps, "", "https://example.org/map.npz", "//[", "a\nb"]
    nowhere += ["u" * 300, "/dev/zero", tmp_path / "outside.npz", maps / "out.npz"]
    for url in nowhere:
        response = client.load_map(url)
        assert response.result == response.RESULT_MAP_DOES_NOT_EXIST, url
    for name in ("broken.npz", "flat.npz", "large.npz"):
        response = client.load_map(maps / name)
        assert response.result == response.RESULT_INVALID_MAP_DATA, name
    client.wait_for_log("the limit is")


def refuse_parameters(server, client, tmp_path):
    odd = tmp_path / "rover.yaml"
    odd.write_text("wheel: !!python/name:os.system\n")
    for name, value, text in [
        ("friction", math.nan, "nan"),
        ("friction", "rough", "Wrong parameter type"),
        ("policy", "fair", "one of equal"),
        ("soil", "snow", "dry_sand"),
        ("payload", -0.5, "payload"),
        ("rover", "lsr9", "lsr9"),
        ("rover", str(odd), "rover.yaml"),
        ("rover", "/dev/zero", "it is a device"),
        ("rover", "r" * 100_000, "rrr"),
        ("map_frame", "odom", "read-only"),
        ("no_such", 1.0, "undeclared"),
        ("", 1.0, "has no name"),
    ]:
        accepted, reason = client.set_parameter(name, value)
        assert not accepted and text in reason and len(reason) <= 300, (name, value, reason)


def refuse_joints(server, client, tmp_path):
    client.send_joints(["rocker_left"], [0.25])
    wait_until(lambda: server.service.joints, "the joints")
    client.send_joints(["rocker_left"], [math.nan])
    client.wait_for_log("joint_states has position nan of rocker_left")
    client.send_joints(["rocker_left", "rocker_right"], [0.1])
    client.send_joints(["bogie_left"], [0.125])
    wait_until(lambda: "bogie_left" in server.service.joints, "the other joint")
    assert server.service.joints == {"rocker_left": 0.25, "bogie_left": 0.125}


@pytest.mark.parametrize(
    "refuse",
    [refuse_requests, refuse_clouds, refuse_paths, refuse_files, refuse_parameters, refuse_joints],
)
def test_bad_input_is_refused_with_its_reason_and_the_node_lives_on(
    mapped, client, ros, tmp_path, refuse
):
    before = mapped.service.known_map.fingerprint
    refuse(mapped, client, tmp_path)
    assert mapped.service.known_map.fingerprint == before and ros.is_alive(mapped)
    assert client.can_traverse(START, GOAL).poses


def test_parameters_take_effect(mapped, client):
    assert client.set_parameter("friction", 0.01) == (True, "")
    assert client.set_parameter("planner", "fan") == (True, "")
    assert ask(client)[1]["code"] == "friction"
    assert client.set_parameter("friction", 0.0) == (True, "")
    assert client.set_parameter("rover", "m2020") == (True, "")
    _, results = client.next_results(lambda: client.can_traverse(START, GOAL))
    assert results["verdict"].status[0].hardware_id == "m2020"
    accepted, reason = client.set_parameter("payload", 3.0)
    assert not accepted and "no manipulator" in reason


def test_a_fault_of_the_program_is_a_refusal_and_not_the_end(mapped, client, ros, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("a fault")

    text = "internal error: ZeroDivisionError: a fault"
    with monkeypatch.context() as patch:
        patch.setattr(Snapshot, "answer", fail)
        assert_refused(client, "internal_error", text, lambda: client.can_traverse(START, GOAL))
    assert client.can_traverse(START, GOAL).poses and ros.is_alive(mapped)
