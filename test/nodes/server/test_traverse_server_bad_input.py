"""Bad input of every kind is refused with a reason and a log line, and the node lives on."""

import array
import json
import math
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import PointCloud2, PointField

from support.hostile_files import archive_of, make_oddities, npy
from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import poses_path, stamped_pose
from rover_physics.terrain.grid import save_terrain
from rover_planner.planning.answering.situation import Situation
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


def test_a_query_before_any_map_is_refused_and_answered_after_it(server, client, ros):
    assert_refused(
        client,
        "no_map",
        "elevation_cloud or call ~/load_map",
        lambda: client.can_traverse(START, GOAL),
    )
    client.send_terrain(make_terrain(waves))
    assert len(client.can_traverse(START, GOAL).poses) > 2
    assert ros.is_alive(server)


def bad_requests():
    def with_nan():
        pose = stamped_pose(GOAL, "map")
        pose.pose.position.x = math.nan
        return stamped_pose(START, "map"), pose, 0.0

    def without_orientation():
        pose = PoseStamped()
        pose.header.frame_id = "map"
        pose.pose.orientation.w = 0.0
        return pose, stamped_pose(GOAL, "map"), 0.0

    good = stamped_pose(START, "map"), stamped_pose(GOAL, "map")
    return [
        ((good[0], stamped_pose(GOAL, "odom"), 0.0), "goal is in frame 'odom'"),
        ((stamped_pose(START, ""), good[1], 0.0), "start is without a frame_id"),
        (with_nan(), "goal has position x nan"),
        (without_orientation(), "start orientation (x 0, y 0, z 0, w 0) has length 0"),
        ((*good, -0.5), "tolerance is -0.5"),
        ((*good, math.nan), "tolerance is nan"),
        ((*good, math.inf), "tolerance is inf"),
        ((good[0], stamped_pose((1e9, 0.0, 0.0), "map"), 0.0), "waypoints"),
    ]


def test_bad_requests_are_refused_and_the_node_lives_on(mapped, client, ros):
    for (start, goal, tolerance), text in bad_requests():
        assert_refused(
            client, "bad_request", text, lambda s=start, g=goal, t=tolerance: client.plan(s, g, t)
        )
        assert ros.is_alive(mapped)
    assert len(client.can_traverse(START, GOAL).poses) > 2


def bad_clouds():
    def changed(**changes):
        cloud = terrain_to_point_cloud(make_terrain(wall_at(0.5)), "map")
        for name, value in changes.items():
            setattr(cloud, name, value)
        return cloud

    integers = changed()
    integers.fields[2].datatype = PointField.INT32
    unnamed = changed()
    unnamed.fields[2].name = "height"
    other_frame = changed()
    other_frame.header.frame_id = "odom"
    unknown = terrain_to_point_cloud(make_terrain(wall_at(0.5)), "map")
    unknown.data = array.array("B", np.full(len(unknown.data) // 4, np.nan, "<f4").tobytes())
    scattered = changed(height=1, width=200, row_step=0)
    scattered.data = array.array(
        "B", np.random.default_rng(1).uniform(-2, 2, (200, 3)).astype("<f4").tobytes()
    )
    return {
        "no field z": unnamed,
        "datatype INT32": integers,
        "it must be in 'map'": other_frame,
        "cloud has no points": PointCloud2(header=changed().header),
        "bytes of data": changed(height=99),
        "need at least": changed(row_step=8),
        "has finite x, y and z": unknown,
        "set map_resolution": scattered,
    }


def test_bad_clouds_are_refused_and_the_last_good_map_stays(mapped, client, ros):
    before = client.can_traverse(START, GOAL)
    for text, cloud in bad_clouds().items():
        client.send_cloud(cloud)
        client.wait_for_log(text)
        assert ros.is_alive(mapped)
    assert any("the last good map stays" in line for line in client.logs)
    assert client.can_traverse(START, GOAL).poses[-1].pose == before.poses[-1].pose


def test_check_path_wants_a_map_and_a_path(server, client):
    answer = client.check_path()
    assert not answer.success and json.loads(answer.message)["code"] == "no_path"
    answer = client.check_poses(server, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert not answer.success and json.loads(answer.message)["code"] == "no_map"


def test_a_bad_path_is_refused_and_not_answered_for_by_the_one_before(mapped, client, ros):
    assert client.check_poses(mapped, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]).success
    twisted = poses_path(np.zeros((3, 3)), "map")
    twisted.poses[1].pose.orientation.w = 0.0
    for path, text in [
        (poses_path(np.zeros((2, 3)), "odom"), "path is in frame 'odom'"),
        (poses_path([], "map"), "path has no poses"),
        (poses_path([[math.nan, 0.0, 0.0]], "map"), "path pose 0 has position x nan"),
        (twisted, "path pose 1 orientation"),
    ]:
        client.send_path(path)
        client.wait_for_log(text)
        verdict = json.loads(client.check_path().message)
        assert verdict["code"] == "no_path" and text in verdict["reason"]
        assert ros.is_alive(mapped)


def test_an_endless_path_is_refused(mapped, client):
    answer = client.check_poses(mapped, [[0.0, 0.0, 0.0], [1e8, 0.0, 0.0]])
    verdict = json.loads(answer.message)
    assert verdict["code"] == "bad_request" and "1e+08 m long" in verdict["reason"]


def test_a_terrain_that_cannot_be_loaded_is_refused_by_result(mapped, client, tmp_path, ros):
    before = mapped.service.terrain
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"no archive")
    empty = tmp_path / "empty.npz"
    np.savez(empty, elevation=np.full((3, 3), np.nan), resolution=0.1, origin=(0.0, 0.0))
    flat = tmp_path / "flat.npz"
    np.savez(flat, elevation=np.zeros((3, 3)), resolution=0.0, origin=(0.0, 0.0))
    for url, result in [
        (tmp_path / "none.npz", "RESULT_MAP_DOES_NOT_EXIST"),
        (tmp_path, "RESULT_MAP_DOES_NOT_EXIST"),
        ("", "RESULT_MAP_DOES_NOT_EXIST"),
        ("https://example.org/map.npz", "RESULT_MAP_DOES_NOT_EXIST"),
        (broken, "RESULT_INVALID_MAP_DATA"),
        (empty, "RESULT_INVALID_MAP_DATA"),
        (flat, "RESULT_INVALID_MAP_DATA"),
    ]:
        response = client.load_map(url)
        assert response.result == getattr(response, result), url
        assert mapped.service.terrain is before and ros.is_alive(mapped)


def test_hostile_files_and_urls_do_not_end_load_map(mapped, client, tmp_path, ros):
    before = mapped.service.terrain
    (tmp_path / "maps").mkdir()
    for name in ("outside.npz", "maps/large.npz"):
        save_terrain(tmp_path / name, make_terrain(waves))
    (tmp_path / "maps" / "out.npz").symlink_to(tmp_path / "outside.npz")
    bomb = npy("{'descr': '<f8', 'fortran_order': False, 'shape': (900000, 900000), }")
    (tmp_path / "maps" / "bomb.npz").write_bytes(archive_of(bomb, "elevation.npy"))
    assert client.set_parameter("map_folder", str(tmp_path / "maps")) == (True, "")
    assert client.set_parameter("max_map_cells", before.elevation.size - 1) == (True, "")
    urls = [
        "u" * 300,
        "//[",
        "http://[bad",
        "a\nb",
        "/dev/zero",
        "/etc/passwd",
        tmp_path / "outside.npz",
        tmp_path / "maps" / "out.npz",
        *make_oddities(tmp_path),
    ]
    for url in [url for url in urls if "\0" not in str(url) and str(url).isprintable()]:
        began = time.monotonic()
        response = client.load_map(url)
        assert response.result == response.RESULT_MAP_DOES_NOT_EXIST, url
        assert time.monotonic() - began < 20.0, url
    for name in ("bomb.npz", "large.npz"):
        response = client.load_map(tmp_path / "maps" / name)
        assert response.result == response.RESULT_INVALID_MAP_DATA, name
    assert mapped.service.terrain is before and ros.is_alive(mapped)
    client.wait_for_log("the limit is")
    assert client.set_parameter("max_map_cells", before.elevation.size) == (True, "")
    response = client.load_map(tmp_path / "maps" / "large.npz")
    assert response.result == response.RESULT_SUCCESS


@pytest.mark.parametrize("content", ["!!timestamp foo", "!!python/name:os.system", "&a [*a]", ""])
def test_a_rover_file_with_odd_contents_is_refused_over_the_node(
    mapped, client, tmp_path, ros, content
):
    rover = tmp_path / "rover.yaml"
    rover.write_text(f"wheel: {content}\n")
    began = time.monotonic()
    accepted, reason = client.set_parameter("rover", str(rover))
    assert not accepted and "rover.yaml" in reason and len(reason) <= 300
    assert time.monotonic() - began < 20.0 and ros.is_alive(mapped)


def test_a_rover_that_is_no_file_is_refused_over_the_node_at_once(mapped, client, tmp_path, ros):
    for name in [*make_oddities(tmp_path), "r" * 100_000]:
        if "\0" in name or not name.isprintable():
            continue
        began = time.monotonic()
        accepted, reason = client.set_parameter("rover", name)
        assert not accepted and 0 < len(reason) <= 300, name
        assert time.monotonic() - began < 20.0 and ros.is_alive(mapped), name
    accepted, reason = client.set_parameter("plan_spacing", 1e-9)
    assert not accepted and reason == (
        "parameter plan_spacing is 1e-09; it must be 0, or at least 0.001 m"
    )
    assert client.can_traverse(START, GOAL).poses


def test_bad_joint_states_leave_the_angles_known_before(mapped, client, ros):
    client.send_joints(["rocker_left"], [0.25])
    wait_until(lambda: mapped.service.joints, "the joints")
    client.send_joints(["rocker_left"], [math.nan])
    client.wait_for_log("joint_states has position nan of rocker_left")
    client.send_joints(["rocker_left", "rocker_right"], [0.1])
    client.send_joints(["bogie_left"], [0.125])
    wait_until(lambda: "bogie_left" in mapped.service.joints, "the other joint")
    assert mapped.service.joints == {"rocker_left": 0.25, "bogie_left": 0.125}
    assert ros.is_alive(mapped)


def test_parameters_take_effect_and_bad_ones_are_refused_with_reasons(mapped, client, ros):
    for name, value, text in [
        ("friction", math.nan, "nan"),
        ("friction", -1.0, "friction"),
        ("friction", "rough", "Wrong parameter type"),
        ("policy", "fair", "one of equal"),
        ("rover", "lsr9", "lsr9"),
        ("map_frame", "odom", "read-only"),
        ("no_such", 1.0, "undeclared"),
        ("", 1.0, "has no name"),
    ]:
        accepted, reason = client.set_parameter(name, value)
        assert not accepted and reason and text in reason, (name, value, reason)
        assert ros.is_alive(mapped)
    assert client.can_traverse(START, GOAL).poses
    assert client.set_parameter("friction", 0.01) == (True, "")
    _, verdict, _ = ask(client)
    assert verdict["code"] == "friction"
    assert client.set_parameter("friction", 0.0) == (True, "")
    assert client.set_parameter("rover", "m2020") == (True, "")
    _, results = client.next_results(lambda: client.can_traverse(START, GOAL))
    assert results["verdict"].status[0].hardware_id == "m2020"


def test_a_fault_of_the_program_is_a_refusal_and_not_the_end(mapped, client, ros, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("a fault")

    monkeypatch.setattr(Situation, "answer", fail)
    assert_refused(
        client,
        "internal_error",
        "internal error: ZeroDivisionError: a fault",
        lambda: client.can_traverse(START, GOAL),
    )
    monkeypatch.undo()
    assert client.can_traverse(START, GOAL).poses and ros.is_alive(mapped)
