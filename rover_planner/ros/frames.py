# SPDX-License-Identifier: Apache-2.0
"""Brings poses of messages to the map frame and to the body, and knows where sensors were."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame, check_transform
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.paths import path_to_poses, pose_to_array, stamped_pose_to_array
from msg_adapters.stamps import stamp_to_ns
from rover_physics.numerics.arrays import Floats
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.sensor_mounts import SensorPoses
from rover_planner.planning.navigation.transforms import (
    Rigid,
    TransformError,
    TransformTree,
    move_path,
)
from rover_planner.ros.optional_types import find_type

TF_DEPTH = 100
"""Messages of /tf that wait to be taken, as in tf2."""
TF_MESSAGE = "tf2_msgs.msg:TFMessage"
FrameParameters = TraverseServerParameters | TractionControllerParameters


class Frames:
    """Knows frames by transforms, and sensors by mounts and odometry too; any thread may ask.

    Messages in the map frame, about a body without offset, are passed on as they are.
    """

    silence = ""
    """Reason why transforms are not heard, to be added to a refusal."""

    def __init__(
        self,
        parameters: FrameParameters,
        now: Callable[[], int],
        sensors: SensorPoses | None = None,
    ):
        """Know only the frame of the map.

        Args:
            parameters: Names of frames, offset and timeout.
            now: Returns the present time [ns].
            sensors: The mounts; None knows where sensors are by transforms alone.
        """
        self._map, self._base = parameters.map_frame, parameters.base_frame
        self.now = now
        """Returns the present time [ns]."""
        self._sensors = sensors
        self._tree = TransformTree(parameters.transform_timeout)
        offset = parameters.base_offset
        self._offset = Rigid.from_rpy(*offset) if any(offset) else None

    def apply_timeout(self, timeout: float) -> None:
        """Take the age from which transforms, and odometry for clouds, are refused [s]."""
        self._tree.timeout = timeout
        if self._sensors is not None:
            self._sensors.driven.timeout = timeout

    def take_transform(self, transform: TransformStamped, *, is_static: bool) -> None:
        """Take a transform of /tf or /tf_static.

        Raises:
            MessageError: It is none.
        """
        check_transform(transform)
        header, moved = transform.header, transform.transform
        self._tree.take(
            header.frame_id,
            transform.child_frame_id,
            stamp_to_ns(header.stamp) or 0,
            Rigid.of(moved.translation, moved.rotation),
            is_static=is_static,
        )

    def find(self, frame: str, stamp: int | None) -> Rigid:
        """Return where a frame is in the map frame at a time [ns]; None is the newest.

        Raises:
            TransformError: As `SensorPoses.find`, else as `TransformTree.find`, with `silence`.
        """
        try:
            if self._sensors is not None:
                return self._sensors.find(frame, stamp, self.now(), self._tree)
            return self._tree.find(self._map, frame, stamp, self.now())
        except TransformError as error:
            raise TransformError(f"{error}{self.silence}") from None

    def find_source(self, frame: str, stamp: int | None, what: str) -> Rigid | None:
        """Return where the frame of a message is in that of the map; None if it is that.

        Raises:
            MessageError: The message, `what` in the text, names no frame.
            TransformError: As `find`.
        """
        if frame in ("", self._map):
            check_frame(frame, self._map, what)
            return None
        return self.find(frame, stamp)

    def find_here(self) -> Floats | None:
        """Return (3,) x, y [m], yaw [rad] of the body on the map by /tf; None without /tf.

        Raises:
            TransformError: The transform is stale, or does not lead to the map frame.
        """
        if not self._tree.has_parent(self._base):
            return None
        robot = self._tree.find(self._map, self._base, None, self.now())
        return self._to_body(robot).xyyaw

    def place_level(self, pose: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return x, y [m], yaw [rad] of the body where the robot is level at such a pose."""
        if self._offset is None:
            return pose
        x, y, yaw = pose
        found = self._to_body(Rigid.from_rpy(x, y, 0.0, 0.0, 0.0, yaw)).xyyaw.tolist()
        return found[0], found[1], found[2]

    def read_pose(self, stamped: PoseStamped, what: str) -> Floats:
        """Return x, y [m], yaw [rad] (3,) of the body in the map frame by a pose of the robot.

        Raises:
            MessageError: Another frame, which no transform has, or no pose; `what` names it.
            TransformError: As `TransformTree.find`.
        """
        moved = self._move(stamped.header, stamped.pose, what)
        return stamped_pose_to_array(stamped, self._map, what) if moved is None else moved.xyyaw

    def read_path(self, path: Path) -> Floats:
        """Return the poses (n, 3) of the body by a path of the robot; see `read_pose`."""
        frame = path.header.frame_id
        is_plain = self._offset is None and (frame == self._map or not self._tree.knows(frame))
        if is_plain or not path.poses:
            return path_to_poses(path, self._map)
        poses = []
        for index, one in enumerate(path.poses):
            header = one.header if one.header.frame_id else path.header
            stamped = PoseStamped(header=header, pose=one.pose)
            poses.append(self.read_pose(stamped, f"path pose {index}"))
        return np.array(poses)

    def take_odometry(self, odometry: Any, base_frame: str = "") -> tuple[Floats, float]:
        """Return the pose of the body in the map frame by odometry; the sensors move with it.

        Args:
            odometry: The message; may be one of `SensorReader`.
            base_frame: As for `odometry_to_pose`.

        Returns:
            x, y, z [m], roll, pitch, yaw [rad] (6,), and the standard deviation of x, y [m].

        Raises:
            MessageError: As `odometry_to_pose`.
            TransformError: As `TransformTree.find`.
        """
        header = odometry.header
        moved = self._move(header, odometry.pose.pose, "odometry")
        frame = self._map if moved is None else header.frame_id
        pose, deviation = odometry_to_pose(odometry, frame, base_frame)
        if moved is not None:
            pose = moved.xyzrpy
        if self._sensors is not None:
            stamp, robot = stamp_to_ns(header.stamp), self._to_robot(Rigid.from_rpy(*pose))
            self._sensors.take(robot, self.now() if stamp is None else stamp)
        return pose, deviation

    def _move(self, header: Any, pose: Any, what: str) -> Rigid | None:
        """Return the body in the map frame.

        None: it is what the pose says, or the frame is one that no transform has.
        """
        frame = header.frame_id
        is_here = frame == self._map
        is_plain = is_here and self._offset is None
        if is_plain or not (is_here or self._tree.knows(frame)):
            return None
        pose_to_array(pose, what)  # refuses what is no pose
        robot = Rigid.of(pose.position, pose.orientation)
        if not is_here:
            stamp = stamp_to_ns(header.stamp)
            robot = self._tree.find(self._map, frame, stamp, self.now()).then(robot)
        return self._to_body(robot)

    def to_base(self, path: Path) -> Path:
        """Change a path of the body into one of the robot, in place, and return it."""
        moved: Path = move_path(path, None if self._offset is None else self._offset.inverse())
        return moved

    def _to_body(self, robot: Rigid) -> Rigid:
        return robot if self._offset is None else robot.then(self._offset)

    def _to_robot(self, body: Rigid) -> Rigid:
        return body if self._offset is None else body.then(self._offset.inverse())


class NodeFrames(Frames):
    """Knows the frames of a node; without tf2_msgs only that of the map."""

    def __init__(
        self, node: Node, parameters: FrameParameters, sensors: SensorPoses | None = None
    ):
        """See `Frames`; `listen` hears of transforms."""
        super().__init__(parameters, lambda: int(node.get_clock().now().nanoseconds), sensors)
        self._node, self._listens = node, False
        if find_type(TF_MESSAGE) is None:
            self.silence = "; /tf needs tf2_msgs, which is not installed"

    def listen(self) -> None:
        """Subscribe to /tf and /tf_static, once, where tf2_msgs is installed."""
        kind = find_type(TF_MESSAGE)
        if kind is None or self._listens:
            return
        self._listens = True
        static = QoSProfile(depth=TF_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_subscription(kind, "/tf", self.take, TF_DEPTH)
        take_static = partial(self.take, is_static=True)
        self._node.create_subscription(kind, "/tf_static", take_static, static)

    def take(self, message: Any, *, is_static: bool = False) -> None:
        """Take a TFMessage of /tf or /tf_static; what is no transform is logged."""
        for transform in message.transforms:
            try:
                self.take_transform(transform, is_static=is_static)
            except MessageError as error:
                self._node.get_logger().warning(str(error), throttle_duration_sec=5.0)


def is_empty(stamped: PoseStamped) -> bool:
    """Return whether a pose was left empty: no frame, all zero, which means "where I am"."""
    place, turn = stamped.pose.position, stamped.pose.orientation
    rest = place.x, place.y, place.z, turn.x, turn.y, turn.z
    return not stamped.header.frame_id and not any(rest) and turn.w in (0.0, 1.0)
