# SPDX-License-Identifier: Apache-2.0
"""Recorded drives are judged again: from SQLite and MCAP, with maps, joints and odometry."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import Reader
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_physics.terrain.grid import Terrain, load_terrain, save_terrain
from rover_planner.cli import main
from rover_planner.command.prediction_files import read_prediction
from rover_planner.nodes.result_topics import RESULT_KINDS
from rover_planner.viewer.state.session import ViewSession
from support.messages.recorded_drives import (
    BEGIN,
    LSR1,
    STORAGES,
    cloud,
    drive,
    odometry_at,
    path_to,
    record,
    replay,
    waves,
)


@pytest.mark.parametrize("storage", STORAGES)
def test_a_drive_is_judged_in_stretches_with_what_was_measured(storage, tmp_path, capsys):
    bag = record(tmp_path / "bag", [("/elevation_cloud", cloud(waves())), *drive(4.0)], storage)
    answers, total = replay(capsys, bag, tmp_path / "out", "--stretch", "1.5")
    assert [answer["kind"] for answer in answers] == ["driven"] * 3
    assert all(answer["traversable"] for answer in answers)
    assert total["refused_messages"] == {} and total["answers"] == 3
    assert total["topics"] == {
        "map": "/elevation_cloud", "joints": "/joint_states", "odometry": "/odometry",
    }  # fmt: skip
    for answer in answers:
        # Poses are kept 5 cm apart, the ground turns the bogies by up to 0.12 rad in 10 cm.
        assert answer["suspension"]["rms"] < 0.025
        measured = np.load(tmp_path / "out" / answer["measured"])
        assert measured["bogie_angle"].shape == (answer["waypoints"], 2)
        assert (np.diff(measured["stamp"]) >= 0).all()
        assert np.ptp(measured["bogie_angle"]) > 0.1
    assert answers[0]["stamp"] == "1700000000.020000000"


def test_the_page_opens_predictions_on_their_maps(tmp_path, capsys):
    bag = record(tmp_path / "bag", [("/elevation_cloud", cloud(waves())), *drive(1.0)])
    (answer,), _ = replay(capsys, bag, tmp_path / "out")
    prediction, reasons = read_prediction(tmp_path / "out" / answer["prediction"])
    ground = load_terrain(tmp_path / "out" / answer["map"])
    np.testing.assert_allclose(ground.elevation, waves().elevation, atol=1e-6)
    session = ViewSession(LSR1, ground, (0.5, 0.0, 0.0), (1.5, 0.0, 0.0))
    session.replay(prediction, reasons)
    assert session.shown.answer.candidates[0].verdict.traversable


def test_predictions_are_recorded_as_a_server_publishes_them(tmp_path, capsys):
    messages = [
        ("/elevation_cloud", cloud(waves())),
        *drive(2.0),
        ("/traverse_server/path", path_to(2.0)),
    ]
    bag = record(tmp_path / "bag", messages)
    answers, _ = replay(capsys, bag, tmp_path / "out", "--stretch", "1")
    assert [answer["kind"] for answer in answers] == ["driven", "check_path", "driven"]
    loads = []
    with Reader(tmp_path / "out" / "predictions") as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        for connection, stamp, raw in reader.messages():
            if connection.topic == "/traverse_server/wheel_loads":
                loads.append((stamp, deserialize_message(bytes(raw), Float64MultiArray).data))
    assert counts == {f"/traverse_server/{name}": 3 for name in RESULT_KINDS}
    told = {answer["stamp"]: answer["prediction"] for answer in answers}
    for stamp, data in loads:
        file = np.load(tmp_path / "out" / told[f"{stamp // 10**9}.{stamp % 10**9:09d}"])
        np.testing.assert_array_equal(np.array(data).reshape(-1, 6), file["wheel_loads"])


def test_each_new_map_is_asked_for_a_goal_from_the_odometry(tmp_path, capsys):
    flat = Terrain(np.zeros((100, 250)), 0.04, (-1.0, -2.0))
    messages = [
        ("/odometry", odometry_at(1.0)),
        ("/elevation_cloud", cloud(waves())),
        ("/elevation_cloud", cloud(waves())),  # the same again
        ("/elevation_cloud", cloud(flat, BEGIN + 1)),
    ]
    bag = record(tmp_path / "bag", messages)
    answers, _ = replay(capsys, bag, tmp_path / "out", "--goal", "3,0.2,0")
    assert [answer["kind"] for answer in answers] == ["can_traverse"] * 2
    assert [answer["map"] for answer in answers] == ["map_001.npz", "map_002.npz"]
    first = np.load(tmp_path / "out" / "001_can_traverse.npz")["poses"]
    np.testing.assert_allclose(first[[0, -1], 0], [1.0, 3.0], atol=1e-6)


def test_local_maps_merge_into_a_loaded_one_as_in_the_server(tmp_path, capsys):
    prior = Terrain(np.zeros((100, 250)), 0.04, (-1.0, -2.0))
    save_terrain(tmp_path / "prior.npz", prior)
    file = tmp_path / "server.yaml"
    file.write_text(f"/**: {{ros__parameters: {{terrain_file: {tmp_path / 'prior.npz'}}}}}\n")
    local = Terrain(np.full((25, 25), 0.1), 0.04, (3.0, -0.52))
    messages = [("/odometry", odometry_at(0.0)), ("/elevation_cloud", cloud(local))]
    bag = record(tmp_path / "bag", messages)
    words = ["--parameters", str(file), "--goal", "1.5,0,0"]
    (answer,), _ = replay(capsys, bag, tmp_path / "out", *words)
    ground = load_terrain(tmp_path / "out" / answer["map"])
    assert ground.elevation.shape == prior.elevation.shape
    assert ground.elevation_at(np.array([3.4]), np.array([0.0]))[0] > 0.05
    assert ground.elevation_at(np.array([0.0]), np.array([0.0]))[0] == 0.0


def test_messages_that_cannot_be_used_are_counted_and_told(tmp_path, capsys):
    messages = [
        ("/elevation_cloud", cloud(waves(), frame="odom")),
        ("/elevation_cloud", cloud(waves())),
        ("/odometry", odometry_at(1.0, frame="odom")),
        ("/joint_states", JointState(name=["bogie_left"], position=[float("nan")])),
    ]
    bag = record(tmp_path / "bag", messages)
    assert main(["replay", str(bag), str(tmp_path / "out")]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["refused_messages"] == {"map": 1, "odometry": 1, "joints": 1}
    assert err.count("not used: ") == 3
    assert "not used: /elevation_cloud at 1700000000.000000000" in err


@pytest.mark.parametrize(
    ("messages", "words", "said"),
    [
        ([("/odometry", odometry_at(0.0))], (), "has no map: PointCloud2 or GridMap"),
        ([("/a", cloud(waves())), ("/b", cloud(waves()))], (), "choose one by --map-topic"),
        ([("/a", cloud(waves()))], ("--map-topic", "/c"), "no topic /c of type .* it has /a"),
        ([("/a", cloud(waves()))], ("--goal", "1,2"), "'--goal': '1,2' is no pose"),
        ([("/a", cloud(waves()))], ("--rover", "lsr9"), "no rover 'lsr9'"),
        ([("/a", cloud(waves()))], ("--parameters", "none.yaml"), "none.yaml"),
    ],
)
def test_bad_input_is_one_line_and_makes_nothing(messages, words, said, tmp_path, capsys):
    bag = record(tmp_path / "bag", messages)
    assert main(["replay", str(bag), str(tmp_path / "out"), *words]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert re.search(said, err), err
    assert not (tmp_path / "out").exists()


def test_what_is_no_bag_and_a_damaged_one_are_refused(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    for bag in (tmp_path / "empty", tmp_path / "none", Path(__file__)):
        assert main(["replay", str(bag), str(tmp_path / "out")]) == 2
        assert "is no bag that can be read" in capsys.readouterr().err
    bag = record(tmp_path / "bag", [("/elevation_cloud", cloud(waves())), *drive(1.0)])
    (file,) = bag.glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[len(content) // 3 :] = b"\x00" * (len(content) - len(content) // 3)
    file.write_bytes(content)
    assert main(["replay", str(bag), str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert err.startswith("rover_planner: ") and err.count("\n") == 1


def test_an_answer_is_never_written_over(tmp_path, capsys):
    bag = record(tmp_path / "bag", [("/elevation_cloud", cloud(waves()))])
    (tmp_path / "out").mkdir()
    assert main(["replay", str(bag), str(tmp_path / "out")]) == 2
    assert "exists already" in capsys.readouterr().err


def test_orientation_of_odometry_is_its_heading(tmp_path, capsys):
    x, y, z, w = xyzw_from_rpy(0.0, 0.0, 0.5).tolist()
    messages = [("/elevation_cloud", cloud(waves()))]
    for k in range(20):
        message = odometry_at(1.0 + 0.05 * k * np.cos(0.5))
        message.pose.pose.position.y = 0.05 * k * np.sin(0.5)
        message.pose.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
        messages.append(("/odometry", message))
    bag = record(tmp_path / "bag", messages)
    (answer,), _ = replay(capsys, bag, tmp_path / "out")
    poses = np.load(tmp_path / "out" / answer["prediction"])["poses"]
    np.testing.assert_allclose(poses[:, 2], 0.5, atol=1e-9)
    assert answer["suspension"] is None  # no joints were recorded
