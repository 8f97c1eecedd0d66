# SPDX-License-Identifier: Apache-2.0
"""Recorded drives are judged again: SQLite and MCAP, maps, joints, IMU, cameras, transforms."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Path as PathMessage
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.identity import path_hash
from msg_adapters.paths import poses_path
from msg_adapters.stamps import ns_to_stamp
from rover_physics import Terrain, judge_path, load_terrain
from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.cli import main
from rover_planner.nodes.result_topics import RESULTS
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.bags.bag_files import GRID_MAP, GRID_MAP_FIELDS, GRID_MAP_INFO_FIELDS
from support.command_line import assert_refused
from support.grounds import make_terrain
from support.messages import grid_map_of, odometry_at, transform_message
from support.paths import poses_at
from support.rovers import LSR1

TF_MESSAGE = "tf2_msgs/msg/TFMessage"
BEGIN = 1_700_000_000_000_000_000
"""Time of the first message [ns]."""
GRID_MAPS = "/elevation_map"
NOT_ON_PYPI = {GRID_MAPS: GRID_MAP, **dict.fromkeys(("/tf", "/tf_static"), TF_MESSAGE)}
"""Types of messages that are objects with their fields, by topic."""
WAVES = make_terrain(lambda x, y: 0.03 * np.sin(4.0 * x + 0.8 * y), 0.04)
"""Ground that turns the suspension."""
STORAGES = {"sqlite": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}


def drive(length: float) -> list[tuple[str, object]]:
    """Return the messages of a drive along x: odometry and the model's suspension each 2 cm."""
    x = np.arange(0.5, 0.5 + length, 0.02)
    prediction = judge_path(LSR1, WAVES, poses_at(x))[0]
    messages: list[tuple[str, object]] = []
    for k, place in enumerate(x.tolist()):
        values = np.concatenate([prediction.rocker_angle[k], prediction.bogie_angle[k]])
        joints = JointState(name=list(SUSPENSION_JOINTS), position=values.tolist())
        messages += [("/joint_states", joints), ("/odometry", odometry_at((place, 0.0, 0.0)))]
    return messages


def cloud(terrain: Terrain, stamp: int = BEGIN, frame: str = "map") -> PointCloud2:
    """Return a terrain as a cloud of a time [ns]."""
    return terrain_to_point_cloud(terrain, frame, ns_to_stamp(stamp))


def path_to(x: float) -> PathMessage:
    """Return a path along the x axis from 1 m to x [m]."""
    path = poses_path([(1.0, 0.0, 0.0), (x, 0.0, 0.0)], "map")
    path.header.stamp = ns_to_stamp(BEGIN + 5)
    return path


def record(folder: Path, messages: list[tuple[str, Any]], storage: str = "mcap") -> Path:
    """Write messages 10 ms apart to a new bag."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for name, fields in (("GridMapInfo", GRID_MAP_INFO_FIELDS), ("GridMap", GRID_MAP_FIELDS)):
        types.register(get_types_from_msg(fields, f"grid_map_msgs/msg/{name}"))
    with Writer(folder, version=9, storage_plugin=STORAGES[storage]) as writer:
        connections = {}
        for k, (topic, message) in enumerate(messages):
            kind = NOT_ON_PYPI.get(topic, "")
            raw = types.serialize_cdr(message, kind) if kind else serialize_message(message)
            if topic not in connections:
                module, name = type(message).__module__.split(".")[0], type(message).__name__
                kind = kind or f"{module}/msg/{name}"
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], BEGIN + 10_000_000 * k, raw)
    return folder


def replay(capsys, bag: Path, out: Path, *words: str) -> tuple[list[dict], dict]:
    """Replay a bag; return its answers and the total."""
    assert main(["replay", str(bag), str(out), *words]) == 0, capsys.readouterr().err
    *answers, total = map(json.loads, capsys.readouterr().out.splitlines())
    return answers, total


def published(out: Path, name: str, kind: type) -> list[tuple[int, Any]]:
    """Return the recorded messages of a topic of the server with their times [ns]."""
    with Reader(out / "predictions") as reader:
        there = [one for one in reader.connections if one.topic == f"/traverse_server/{name}"]
        return [
            (stamp, deserialize_message(bytes(raw), kind))
            for _, stamp, raw in reader.messages(there)
        ]


@pytest.mark.parametrize("storage", STORAGES)
def test_a_drive_is_judged_in_stretches_and_answers_are_recorded_as_a_server_publishes_them(
    storage, tmp_path, capsys
):
    seen, name = cloud(WAVES), "/elevation_cloud"
    if storage == "sqlite":
        seen, name = grid_map_of({"elevation": WAVES.elevation}, 0.04), GRID_MAPS
    messages = [(name, seen), *drive(1.6), ("/traverse_server/path", path_to(2.0))]
    bag = record(tmp_path / "bag", messages, storage)
    answers, total = replay(capsys, bag, tmp_path / "out", "--stretch", "1")
    assert [answer["kind"] for answer in answers] == ["driven", "check_path", "driven"]
    assert all(answer["traversable"] for answer in answers)
    assert total["refused_messages"] == {} and total["answers"] == 3
    assert total["topics"] == {
        "map": name, "joints": "/joint_states", "odometry": "/odometry",
        "path": "/traverse_server/path",
    }  # fmt: skip
    for answer in answers[::2]:
        # Poses are kept 5 cm apart, the ground turns the bogies by up to 0.12 rad in 10 cm.
        assert answer["suspension"]["rms"] < 0.025
        measured = np.load(tmp_path / "out" / answer["measured"])
        assert measured["bogie_angle"].shape == (answer["waypoints"], 2)
        assert (np.diff(measured["stamp"]) >= 0).all()
        assert np.ptp(measured["bogie_angle"]) > 0.1
    assert answers[0]["stamp"] == "1700000000.020000000"
    with Reader(tmp_path / "out" / "predictions") as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts == {f"/traverse_server/{name}": 3 for name in RESULTS}
    told = {answer["stamp"]: answer["prediction"] for answer in answers}
    for stamp, loads in published(tmp_path / "out", "wheel_loads", Float64MultiArray):
        file = np.load(tmp_path / "out" / told[f"{stamp // 10**9}.{stamp % 10**9:09d}"])
        np.testing.assert_array_equal(np.array(loads.data).reshape(-1, 6), file["wheel_loads"])


def test_each_new_map_is_asked_for_a_goal_from_the_odometry_and_not_for_a_path(tmp_path, capsys):
    flat = make_terrain(lambda x, y: 0.0 * x)
    messages = [
        ("/odometry", odometry_at((1.0, 0.0, 0.0))),
        ("/elevation_cloud", cloud(WAVES)),
        ("/elevation_cloud", cloud(WAVES)),  # the same again
        ("/traverse_server/path", path_to(2.0)),
        ("/elevation_cloud", cloud(flat, BEGIN + 1)),
    ]
    bag = record(tmp_path / "bag", messages)
    answers, _ = replay(capsys, bag, tmp_path / "out", "--goal", "3,0.2,0")
    assert [answer["kind"] for answer in answers] == ["can_traverse", "check_path", "can_traverse"]
    assert [answer["map"] for answer in answers[::2]] == ["map_001.npz", "map_002.npz"]
    verdicts = published(tmp_path / "out", "verdict", DiagnosticArray)
    told = [{one.key: one.value for one in verdict.status[0].values} for _, verdict in verdicts]
    assert [one["path_hash"] for one in told] == ["", path_hash(path_to(2.0)), ""]
    first = np.load(tmp_path / "out" / "001_can_traverse.npz")["poses"]
    np.testing.assert_allclose(first[[0, -1], 0], [1.0, 3.0], atol=1e-6)


def test_messages_that_cannot_be_used_are_counted_and_told(tmp_path, capsys):
    messages = [
        ("/elevation_cloud", cloud(WAVES, frame="odom")),
        ("/elevation_cloud", cloud(WAVES)),
        ("/odometry", odometry_at((1.0, 0.0, 0.0), frame="odom")),
        ("/joint_states", JointState(name=["bogie_left"], position=[float("nan")])),
        ("/imu", Imu(orientation=Quaternion(w=0.0))),
    ]
    bag, file = record(tmp_path / "bag", messages), tmp_path / "server.yaml"
    file.write_text("/**: {ros__parameters: {imu_attitude: true}}\n")
    assert main(["replay", str(bag), str(tmp_path / "out"), "--parameters", str(file)]) == 0
    out, err = capsys.readouterr()
    refused = json.loads(out)["refused_messages"]
    assert refused == dict.fromkeys(("map", "odometry", "joints", "imu"), 1)
    assert err.count("not used: ") == 4
    assert "not used: /elevation_cloud at 1700000000.000000000" in err


NO_TOPIC = f"no topic /c of type sensor_msgs/msg/PointCloud2 or {GRID_MAP} in the bag; it has /a"


@pytest.mark.parametrize(
    ("messages", "words", "said"),
    [
        ([("/odometry", odometry_at((0.0, 0.0, 0.0)))], (), "has no map: PointCloud2 or GridMap"),
        ([("/a", cloud(WAVES)), ("/b", cloud(WAVES))], (), "choose one by --map-topic"),
        ([("/a", cloud(WAVES))], ("--map-topic", "/c"), NO_TOPIC),
        ([("/a", cloud(WAVES))], ("--parameters", "none.yaml"), "none.yaml"),
    ],
)
def test_bad_input_is_one_line_and_makes_nothing(messages, words, said, tmp_path, capfd):
    bag = record(tmp_path / "bag", messages)
    assert_refused(capfd, main(["replay", str(bag), str(tmp_path / "out"), *words]), said)
    assert not (tmp_path / "out").exists()


def test_what_is_no_bag_and_a_damaged_one_are_refused(tmp_path, capfd):
    (tmp_path / "empty").mkdir()
    for bag in (tmp_path / "empty", tmp_path / "none", Path(__file__)):
        code = main(["replay", str(bag), str(tmp_path / "out")])
        assert_refused(capfd, code, "is no bag that can be read")
    bag = record(tmp_path / "bag", [("/elevation_cloud", cloud(WAVES)), *drive(1.0)])
    (file,) = bag.glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[len(content) // 3 :] = b"\x00" * (len(content) - len(content) // 3)
    file.write_bytes(content)
    assert_refused(capfd, main(["replay", str(bag), str(tmp_path / "out")]), str(bag))


def test_recorded_transforms_place_odometry_and_clouds_on_the_map(tmp_path, capsys):
    map_odom = Rigid.from_rpy(2.0, -1.0, 0.3, 0.0, 0.0, 1.1)
    mount = Rigid.from_rpy(0.4, 0.0, 0.6, 0.0, 0.5, 0.0)
    on_map = Rigid.from_rpy(1.0, 0.0, 0.25, 0.0, 0.0, 0.0)
    in_odom, in_camera = map_odom.inverse().then(on_map), on_map.then(mount).inverse()
    odometry = odometry_at(in_odom.xyyaw, in_odom.translation[2], "odom")
    odometry.header.stamp = ns_to_stamp(BEGIN)
    plain, seen = cloud(WAVES), cloud(WAVES, frame="camera")
    points = np.frombuffer(plain.data, "<f4").reshape(-1, 3)
    moved = in_camera.rotation.apply(points) + in_camera.translation
    seen.data = moved.astype("<f4").tobytes()
    edges = {"/tf": ("map", "odom", map_odom), "/tf_static": ("base_link", "camera", mount)}
    messages = [
        (topic, SimpleNamespace(transforms=[transform_message(*edge, ns_to_stamp(BEGIN))]))
        for topic, edge in edges.items()
    ]
    messages += [("/odometry", odometry), ("/elevation_cloud", seen)]
    bag = record(tmp_path / "bag", messages)
    words = ["--resolution", "0.04", "--goal", "3,0.2,0"]
    (answer,), total = replay(capsys, bag, tmp_path / "out", *words)
    assert total["refused_messages"] == {} and total["topics"]["tf"] == "/tf"
    ground = load_terrain(tmp_path / "out" / answer["map"])
    x, y = np.meshgrid(np.arange(0.0, 4.0, 0.1), np.arange(-1.0, 1.0, 0.1))
    np.testing.assert_allclose(ground.elevation_at(x, y), WAVES.elevation_at(x, y), atol=2e-3)
    poses = np.load(tmp_path / "out" / answer["prediction"])["poses"]
    np.testing.assert_allclose(poses[0], [1.0, 0.0, 0.0], atol=1e-6)


def test_paths_goals_and_answers_are_those_of_the_robot_with_its_offset_and_joints(
    tmp_path, capsys
):
    messages = [("/elevation_cloud", cloud(WAVES)), ("/traverse_server/path", path_to(2.0))]
    bag, file = record(tmp_path / "bag", messages), tmp_path / "server.yaml"
    file.write_text(
        "/**: {ros__parameters: {base_offset: [0.2, 0.1, 0.3, 0.0, 0.0, 0.0], "
        "joint_map: ['bogie_right:bogie_r:-1']}}\n"
    )
    words = ["--parameters", str(file), "--start", "1,0,0", "--goal", "2,0,0"]
    answers, _ = replay(capsys, bag, tmp_path / "out", *words)
    assert [answer["kind"] for answer in answers] == ["can_traverse", "check_path"]
    sent = path_to(2.0).poses[0].pose.position
    for answer, begin in zip(answers, ((1.0, 0.0), (sent.x, sent.y)), strict=True):
        poses = np.load(tmp_path / "out" / answer["prediction"])["poses"]
        np.testing.assert_allclose(poses[0, :2], np.add(begin, (0.2, 0.1)), atol=1e-6)
    (_, plan), *_ = published(tmp_path / "out", "plan", PathMessage)
    place = plan.poses[0].pose.position
    np.testing.assert_allclose([place.x, place.y], [1.0, 0.0], atol=0.1)  # the rover leans
    for _, joints in published(tmp_path / "out", "predicted_joints", JointTrajectory):
        assert "bogie_r" in joints.joint_names and "bogie_right" not in joints.joint_names


def test_what_lacks_to_ask_a_question_is_told_and_an_answer_is_never_written_over(
    tmp_path, capsys
):
    bag = record(tmp_path / "bag", [("/elevation_cloud", cloud(WAVES))])
    for words, code, said in (
        (["nothing"], 0, "nothing was asked: the bag has no path and no odometry; give --goal"),
        (["goal", "--goal=2,0,0"], 0, "no odometry before them tells where it starts"),
        (["start", "--start=2,0,0"], 2, "--goal, which is not given"),
        (["nothing"], 2, "exists already"),
    ):
        assert main(["replay", str(bag), str(tmp_path / words[0]), *words[1:]]) == code
        assert said in capsys.readouterr().err
