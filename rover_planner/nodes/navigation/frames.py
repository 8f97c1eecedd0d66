# SPDX-License-Identifier: Apache-2.0
"""Transforms poses of messages to the map frame and to the body; listens to /tf and /tf_static."""

import copy
from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from msg_adapters.errors import MessageError
from msg_adapters.frames import read_transform
from msg_adapters.paths import pose_to_array
from msg_adapters.stamps import stamp_to_ns
from rover_planner.planning.navigation.transforms import (
    Rigid,
    TransformError,
    TransformTree,
    move_path,
    read_pose,
    write_pose,
)

TF_DEPTH = 100
"""Messages of /tf that wait to be taken, as in tf2."""


def tf_message() -> type | None:
    """Return tf2_msgs/msg/TFMessage; None where it is not installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return None
    kind: type = TFMessage
    return kind


class FrameParameters(Protocol):
    """What nodes that know frames have as parameters."""

    @property
    def map_frame(self) -> str:
        """Frame of the map."""

    @property
    def base_frame(self) -> str:
        """Frame of the robot."""

    @property
    def base_offset(self) -> tuple[float, ...]:
        """(6,) x, y, z [m], roll, pitch, yaw [rad] of the body in the frame of the robot."""

    @property
    def transform_timeout(self) -> float:
        """Age from which a transform is refused [s]."""


class Frames:
    """Knows the frames of a node; without tf2_msgs only that of the map.

    Messages in the map frame, about a body without offset, are passed on as they are.
    """

    def __init__(self, node: Node, parameters: FrameParameters):
        """Know only the frame of the map; `listen` hears of others."""
        self._node = node
        self._map, self._base = parameters.map_frame, parameters.base_frame
        self._tree = TransformTree(parameters.transform_timeout)
        offset = parameters.base_offset
        self._offset = Rigid.from_rpy(*offset) if any(offset) else None
        self._listens = False

    def listen(self) -> None:
        """Subscribe to /tf and /tf_static, once, where tf2_msgs is installed."""
        kind = tf_message()
        if kind is None or self._listens:
            return
        self._listens = True
        static = QoSProfile(depth=TF_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_subscription(kind, "/tf", self.take, TF_DEPTH)
        self._node.create_subscription(kind, "/tf_static", self.take_static, static)

    @property
    def silence(self) -> str:
        """Why /tf says nothing, to be added to a refusal; empty if it is heard."""
        return "" if tf_message() is not None else "; /tf needs tf2_msgs, which is not installed"

    def apply_timeout(self, timeout: float) -> None:
        """Take the age from which transforms are refused [s]."""
        self._tree.timeout = timeout

    def take(self, message: Any) -> None:
        """Take a TFMessage of /tf."""
        self._take(message.transforms, is_static=False)

    def take_static(self, message: Any) -> None:
        """Take a TFMessage of /tf_static."""
        self._take(message.transforms, is_static=True)

    def find(self, frame: str, stamp: int | None) -> Rigid:
        """Return where a frame was in the map frame at a time [ns]; None is the newest.

        Any thread may call it.

        Raises:
            TransformError: As `TransformTree.find`, with what keeps /tf from being heard.
        """
        try:
            return self._tree.find(self._map, frame, stamp, self._now())
        except TransformError as error:
            raise TransformError(f"{error}{self.silence}") from None

    def find_here(self) -> NDArray[np.float64] | None:
        """Return (3,) x, y [m], yaw [rad] of the body on the map by /tf; None without /tf.

        Raises:
            TransformError: The transform is stale, or does not lead to the map frame.
        """
        if not self._tree.has_parent(self._base):
            return None
        robot = self._tree.find(self._map, self._base, None, self._now())
        return self._to_body(robot).xyyaw

    def localise(self, stamped: PoseStamped, what: str) -> PoseStamped:
        """Return a pose of the robot as one of the body in the map frame.

        A pose in a frame that no transform has is returned as it is, for others to refuse.

        Raises:
            MessageError: The pose is not finite, or no unit quaternion.
            TransformError: As `TransformTree.find`.
        """
        frame = stamped.header.frame_id
        is_here = frame == self._map or not self._tree.knows(frame)
        if is_here and self._offset is None:
            return stamped
        pose_to_array(stamped.pose, what)  # refuses what is no pose
        rigid = read_pose(stamped.pose)
        if not is_here:
            stamp = stamp_to_ns(stamped.header.stamp)
            rigid = self._tree.find(self._map, frame, stamp, self._now()).then(rigid)
        moved = PoseStamped(pose=_make_pose(self._to_body(rigid)))
        moved.header.stamp = stamped.header.stamp
        moved.header.frame_id = frame if is_here else self._map
        return moved

    def localise_path(self, path: Path) -> Path:
        """Return a path of the robot as one of the body in the map frame; see `localise`."""
        frame = path.header.frame_id
        if self._offset is None and (frame == self._map or not self._tree.knows(frame)):
            return path
        moved = Path(header=copy.deepcopy(path.header))
        for index, pose in enumerate(path.poses):
            own = PoseStamped(header=pose.header, pose=pose.pose)
            if not own.header.frame_id:
                own.header = path.header
            moved.poses.append(self.localise(own, f"path pose {index}"))
        if moved.poses:
            moved.header.frame_id = moved.poses[0].header.frame_id
        return moved

    def localise_odometry(self, odometry: Odometry) -> Odometry:
        """Return odometry of the body in the map frame; see `localise`."""
        here = PoseStamped(header=odometry.header, pose=odometry.pose.pose)
        moved = self.localise(here, "odometry")
        if moved is here:
            return odometry
        result = Odometry(header=moved.header, child_frame_id=odometry.child_frame_id)
        result.pose.pose, result.pose.covariance = moved.pose, odometry.pose.covariance
        return result

    def to_base(self, path: Path) -> Path:
        """Change a path of the body into one of the robot, in place, and return it."""
        moved: Path = move_path(path, None if self._offset is None else self._offset.inverse())
        return moved

    def _to_body(self, robot: Rigid) -> Rigid:
        return robot if self._offset is None else robot.then(self._offset)

    def _now(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _take(self, transforms: list[TransformStamped], *, is_static: bool) -> None:
        for transform in transforms:
            try:
                at = read_transform(transform)
            except MessageError as error:
                self._node.get_logger().warning(str(error), throttle_duration_sec=5.0)
                continue
            self._tree.take(at.parent, at.child, at.stamp, Rigid.of(at), is_static=is_static)


def is_empty(stamped: PoseStamped) -> bool:
    """Return whether a pose was left empty: no frame, all zero, which means "where I am"."""
    place, turn = stamped.pose.position, stamped.pose.orientation
    rest = place.x, place.y, place.z, turn.x, turn.y, turn.z
    return not stamped.header.frame_id and not any(rest) and turn.w in (0.0, 1.0)


def _make_pose(rigid: Rigid) -> Pose:
    pose = Pose()
    write_pose(rigid, pose)
    return pose
