# SPDX-License-Identifier: Apache-2.0
"""Recorded drives for tests: ground, a rover's messages, bags with them, and their replay."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Imu, JointState, PointCloud2

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.stamps import ns_to_stamp
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_planner.cli import main
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.bags.bag_reader import GRID_MAP, GRID_MAP_FIELDS, GRID_MAP_INFO_FIELDS

LSR1 = load_rover("lsr1")
BEGIN = 1_700_000_000_000_000_000
"""Time of the first message [ns]."""
STORAGES = {"sqlite": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}


def waves() -> Terrain:
    """Return ground 10 m x 4 m with waves that turn the suspension."""
    X, Y = np.meshgrid(np.arange(-1.0, 9.0, 0.04), np.arange(-2.0, 2.0, 0.04))
    return Terrain(0.03 * np.sin(4.0 * X + 0.8 * Y), 0.04, (-1.0, -2.0))


def odometry_at(x: float, frame: str = "map") -> Odometry:
    """Return a level rover at x [m] on the x axis of a frame."""
    message = Odometry()
    message.header.frame_id = frame
    message.pose.pose.position = Point(x=x)
    message.pose.pose.orientation.w = 1.0
    return message


def joints_of(angles: dict[str, float]) -> JointState:
    """Return joint angles [rad] by name."""
    return JointState(name=list(angles), position=list(angles.values()))


def drive(length: float, off: float = 0.0) -> list[tuple[str, object]]:
    """Return the messages of a drive along x: odometry and suspension angles each 2 cm.

    The angles are those of the model, plus `off` [rad] for the bogies.
    """
    x = np.arange(0.5, 0.5 + length, 0.02)
    poses = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    prediction = judge_path(LSR1, waves(), poses)[0]
    messages: list[tuple[str, object]] = []
    for k, place in enumerate(x.tolist()):
        right, left = prediction.bogie_angle[k].tolist()
        angles = {
            "rocker_right": float(prediction.rocker_angle[k, 0]),
            "rocker_left": float(prediction.rocker_angle[k, 1]),
            "bogie_right": right + off,
            "bogie_left": left + off,
        }
        messages += [("/joint_states", joints_of(angles)), ("/odometry", odometry_at(place))]
    return messages


def cloud(terrain: Terrain, stamp: int = BEGIN, frame: str = "map") -> PointCloud2:
    """Return a terrain as a cloud of a time [ns]."""
    return terrain_to_point_cloud(terrain, frame, ns_to_stamp(stamp))


def path_to(x: float) -> PathMessage:
    """Return a path along the x axis from 1 m to x [m]."""
    message = PathMessage()
    message.header.frame_id = "map"
    message.header.stamp = ns_to_stamp(BEGIN + 5)
    for place in (1.0, x):
        pose = PoseStamped()
        pose.pose.position.x = place
        pose.pose.orientation = Quaternion(w=1.0)
        message.poses.append(pose)
    return message


def record(folder: Path, messages: list[tuple[str, Any]], storage: str = "mcap") -> Path:
    """Write messages 10 ms apart to a new bag: those of ROS, of the bag's library, or GridMaps."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for name, fields in (("GridMapInfo", GRID_MAP_INFO_FIELDS), ("GridMap", GRID_MAP_FIELDS)):
        types.register(get_types_from_msg(fields, f"grid_map_msgs/msg/{name}"))
    with Writer(folder, version=9, storage_plugin=STORAGES[storage]) as writer:
        connections = {}
        for k, (topic, message) in enumerate(messages):
            module, name = type(message).__module__.split(".")[0], type(message).__name__
            is_grid_map = isinstance(message, SimpleNamespace)
            kind = GRID_MAP if is_grid_map else getattr(message, "__msgtype__", "")
            raw = types.serialize_cdr(message, kind) if kind else serialize_message(message)
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, kind or f"{module}/msg/{name}", typestore=types
                )
            writer.write(connections[topic], BEGIN + 10_000_000 * k, raw)
    return folder


def replay(capsys, bag: Path, out: Path, *words: str) -> tuple[list[dict], dict]:
    """Replay a bag; return its answers and the total."""
    assert main(["replay", str(bag), str(out), *words]) == 0, capsys.readouterr().err
    *answers, total = map(json.loads, capsys.readouterr().out.splitlines())
    return answers, total


def imu_at(roll: float) -> Imu:
    """Return the attitude of a rover that leans by a roll [rad]."""
    message = Imu()
    x, y, z, w = xyzw_from_rpy(roll, 0.0, 0.0).tolist()
    message.orientation = Quaternion(x=x, y=y, z=z, w=w)
    return message


def transforms_of(parent: str, child: str, rigid: Rigid):
    """Return a TFMessage of the bag's library; tf2_msgs is not on PyPI."""
    types = get_typestore(Stores.ROS2_JAZZY).types
    geometry = {
        name: types[f"geometry_msgs/msg/{name}"]
        for name in ("TransformStamped", "Transform", "Vector3", "Quaternion")
    }
    time = types["builtin_interfaces/msg/Time"](BEGIN // 10**9, BEGIN % 10**9)
    transform = geometry["Transform"](
        geometry["Vector3"](*rigid.translation.tolist()),
        geometry["Quaternion"](*rigid.rotation.as_quat().tolist()),
    )
    header = types["std_msgs/msg/Header"](time, parent)
    stamped = geometry["TransformStamped"](header, child, transform)
    return types["tf2_msgs/msg/TFMessage"]([stamped])
