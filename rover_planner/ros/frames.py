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
from msg_adapters.paths import path_to_poses, pose_to_array
from msg_adapters.sensors import odometry_to_pose
from msg_adapters.stamps import stamp_to_ns
from rover_physics.numerics.arrays import Floats
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.transforms import (
    Rigid,
    TransformError,
    TransformTree,
    read_mounts,
)
from rover_planner.shell.extras import find_type

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

    def __init__(self, parameters: FrameParameters, now: Callable[[], int]):
        """Know only the frame of the map, and mounts if there is a parameter of them.

        Args:
            parameters: Names of frames, offset, timeout and mounts.
            now: Returns the present time [ns].

        Raises:
            PlanningError: The parameter sensor_mounts is wrong.
        """
        self._map, self._base = parameters.map_frame, parameters.base_frame
        self.now = now
        """Returns the present time [ns]."""
        self._mounts: dict[str, Rigid] | None = None
        if isinstance(parameters, TraverseServerParameters):
            self._mounts = {self._base: Rigid.none(), **read_mounts(parameters.sensor_mounts)}
        self._tree = TransformTree(parameters.transform_timeout)
        self._driven = TransformTree(parameters.transform_timeout)  # the robot by odometry
        offset = parameters.base_offset
        self._offset = Rigid.from_rpy(*offset) if any(offset) else None

    def listen(self) -> None:
        """Begin to hear of transforms, unless `take_transform` is called with all of them."""

    def apply_timeout(self, timeout: float) -> None:
        """Take the age from which transforms, and odometry for clouds, are refused [s]."""
        self._tree.timeout = self._driven.timeout = timeout

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

        The mount of a sensor on the robot is that of the parameter, else that of /tf. The robot is
        where /tf says; if /tf does not connect it with the map, where odometry does.

        Raises:
            TransformError: The mount is not known, or the robot's pose is not known then, or
                stale; with `silence`.
        """
        try:
            if self._mounts is None:
                return self._find_by_tf(self._map, frame, stamp)
            mount = self._mounts.get(frame)
            if mount is None:
                if self._tree.connects(self._map, frame):
                    return self._find_by_tf(self._map, frame, stamp)
                if not self._tree.connects(self._base, frame):
                    raise TransformError(
                        f"the message is in frame {frame!r}; it must be in {self._map!r}, or in a "
                        "frame of /tf or sensor_mounts; known are "
                        + ", ".join(sorted({*self._mounts, *self._tree.frames()}))
                    )
                mount = self._find_by_tf(self._base, frame, stamp)
            return self._find_robot(stamp).then(mount)
        except TransformError as error:
            raise TransformError(f"{error}{self.silence}") from None

    def _find_by_tf(self, target: str, source: str, stamp: int | None) -> Rigid:
        return self._tree.find(target, source, stamp, self.now())

    def _find_robot(self, stamp: int | None) -> Rigid:
        """Return where the robot's frame is in that of the map, by /tf or by odometry."""
        if self._tree.connects(self._map, self._base):
            return self._find_by_tf(self._map, self._base, stamp)
        if not self._driven.has_parent(self._base):
            raise TransformError(
                f"neither /tf nor odometry says where {self._base!r} is in {self._map!r}"
            )
        try:
            return self._driven.find(self._map, self._base, stamp, self.now())
        except TransformError as error:
            raise TransformError(f"by odometry: {error}") from None

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
        return self._to_body(self._find_by_tf(self._map, self._base, None)).xyyaw

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
        if moved is not None:
            return moved.xyyaw
        check_frame(stamped.header.frame_id, self._map, what)
        return pose_to_array(stamped.pose, what)

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
            odometry: The message; may be one of `read_raw`.
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
        if self._mounts is not None:
            body, stamp = Rigid.from_rpy(*pose), stamp_to_ns(header.stamp)
            robot = body if self._offset is None else body.then(self._offset.inverse())
            self._driven.take(self._map, self._base, stamp or self.now(), robot)
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
            robot = self._find_by_tf(self._map, frame, stamp).then(robot)
        return self._to_body(robot)

    def to_base(self, path: Path) -> Path:
        """Change a path of the body into one of the robot, in place, and return it."""
        if self._offset is None:
            return path
        back = self._offset.inverse()
        for stamped in path.poses:
            place, turn = stamped.pose.position, stamped.pose.orientation
            robot = Rigid.of(place, turn).then(back)
            place.x, place.y, place.z = robot.translation.tolist()
            turn.x, turn.y, turn.z, turn.w = robot.rotation.as_quat().tolist()
        return path

    def _to_body(self, robot: Rigid) -> Rigid:
        return robot if self._offset is None else robot.then(self._offset)


class NodeFrames(Frames):
    """Knows the frames of a node; without tf2_msgs only that of the map."""

    def __init__(self, node: Node, parameters: FrameParameters):
        """See `Frames`; `listen` hears of transforms."""
        super().__init__(parameters, lambda: int(node.get_clock().now().nanoseconds))
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
