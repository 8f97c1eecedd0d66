# SPDX-License-Identifier: Apache-2.0
"""Messages for tests: of a drive, of the arm's tool, of /tf, and GridMaps.

A GridMap is an object with the fields of grid_map_msgs/GridMap; tf2_msgs is not on PyPI either.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from msg_adapters.paths import stamped_pose
from msg_adapters.stamps import ns_to_stamp
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_planner.learning import drive_log as log
from rover_planner.planning.navigation.transforms import Rigid


def row_messages(row: Floats, begin: float) -> tuple[JointState, Odometry]:
    """Return joint states and odometry of a row of a drive that began at a time [s]."""
    joints = JointState(name=[*SUSPENSION_JOINTS, *WHEEL_JOINTS])
    joints.position = [*row[log.SUSPENSION].tolist(), *([0.0] * len(WHEEL_JOINTS))]
    joints.velocity = [0.0] * len(SUSPENSION_JOINTS) + row[log.RATES].tolist()
    joints.effort = [0.0] * len(SUSPENSION_JOINTS) + row[log.TORQUES].tolist()
    odometry = odometry_at(row[[log.X, log.Y, log.YAW]])
    odometry.header.stamp = ns_to_stamp(int((begin + row[log.TIME]) * 1e9))
    turn = odometry.pose.pose.orientation
    turn.x, turn.y, turn.z, turn.w = xyzw_from_rpy(*row[[log.ROLL, log.PITCH, log.YAW]]).tolist()
    return joints, odometry


def odometry_at(pose, height: float = 0.0, frame: str = "map") -> Odometry:
    """Return odometry of a level rover at a pose: x, y [m], yaw [rad]."""
    odometry = Odometry(child_frame_id="base_link")
    odometry.header.frame_id, odometry.pose.pose = frame, stamped_pose(pose, frame).pose
    odometry.pose.pose.position.z = height
    return odometry


def make_target(x=1.0, y=2.0, z=0.3, frame="map") -> PoseStamped:
    """Return a target position for the tip of the arm [m]."""
    target = PoseStamped(header=Header(frame_id=frame))
    target.pose.position.x, target.pose.position.y, target.pose.position.z = x, y, z
    return target


def make_wrench(force=(1.0, 2.0, 3.0), moment=(4.0, 5.0, 6.0), frame="map") -> WrenchStamped:
    """Return force [N] and moment [N m] on the tip of the arm."""
    wrench = WrenchStamped(header=Header(frame_id=frame))
    for vector, values in ((wrench.wrench.force, force), (wrench.wrench.torque, moment)):
        vector.x, vector.y, vector.z = values
    return wrench


def transform_message(parent: str, child: str, rigid: Rigid, stamp: Time) -> TransformStamped:
    """Return the message that tells where a child frame is in its parent frame."""
    header = Header(frame_id=parent, stamp=stamp)
    message = TransformStamped(header=header, child_frame_id=child)
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = rigid.translation.tolist()
    turn.x, turn.y, turn.z, turn.w = rigid.rotation.as_quat().tolist()
    return message


def send_map_odom(node: Any, rigid: Rigid, age: float = 0.0, is_static: bool = False) -> None:
    """Tell the frames of a node in a TFMessage of an age [s] where odom is on the map."""
    stamp = (node.get_clock().now() - Duration(seconds=age)).to_msg()
    transform = transform_message("map", "odom", rigid, stamp)
    node.frames.take(SimpleNamespace(transforms=[transform]), is_static=is_static)


def set_field(message: Any, path: str, value: Any) -> None:
    """Set a field of a message, given by names and places in lists such as poses.2.pose."""
    *inner, last = path.split(".")
    for name in inner:
        message = message[int(name)] if name.isdigit() else getattr(message, name)
    setattr(message, last, value)


def grid_map_of(
    layers: dict[str, np.ndarray],
    resolution: float = 0.05,
    centre: tuple[float, float] = (0.0, 0.0),
    basic: tuple[str, ...] = ("elevation",),
    order: str = "F",
    start: tuple[int, int] = (0, 0),
) -> Any:
    """Return a GridMap of layers (ny, nx), x, y ascending; grid_map itself stores by columns.

    Its circular buffer starts at a row and a column.
    """
    ny, nx = next(iter(layers.values())).shape
    header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0), frame_id="map")
    position = SimpleNamespace(x=centre[0], y=centre[1], z=0.0)
    orientation = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    info = SimpleNamespace(
        resolution=resolution,
        length_x=nx * resolution,
        length_y=ny * resolution,
        pose=SimpleNamespace(position=position, orientation=orientation),
    )
    sizes = {"column_index": ny, "row_index": nx}
    labels = list(sizes) if order == "F" else list(sizes)[::-1]
    strides = nx * ny, sizes[labels[1]]
    dim = [
        SimpleNamespace(label=label, size=sizes[label], stride=stride)
        for label, stride in zip(labels, strides, strict=True)
    ]
    data = []
    for values in layers.values():
        stored = np.asarray(values, np.float32)[::-1, ::-1].T  # rows along -x, columns along -y
        cells = np.roll(stored, start, (0, 1)).ravel(order)
        layout = SimpleNamespace(dim=dim, data_offset=0)
        data.append(SimpleNamespace(layout=layout, data=cells))
    return SimpleNamespace(
        header=header,
        info=info,
        layers=list(layers),
        basic_layers=[name for name in basic if name in layers],
        data=data,
        outer_start_index=start[0],
        inner_start_index=start[1],
    )
