# SPDX-License-Identifier: Apache-2.0
"""Where robot and sensors of a recording were on the map: transforms, odometry and mounts."""

from typing import Any

import numpy as np
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray

from msg_adapters.frames import check_frame, read_transform
from msg_adapters.odometry import odometry_to_pose, odometry_to_tilt
from msg_adapters.paths import path_to_poses
from msg_adapters.stamps import stamp_to_ns
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.sensor_mounts import sensor_poses
from rover_planner.planning.navigation.transforms import Rigid, TransformTree, move_path, read_pose


class RecordedFrames:
    """Knows the frames of a recording; times are stamps, else times of recording."""

    def __init__(self, parameters: TraverseServerParameters):
        """Take frames, mounts and offset of the parameters.

        Raises:
            PlanningError: The parameter sensor_mounts is wrong.
        """
        self._map = parameters.map_frame
        self._tree = TransformTree(parameters.transform_timeout)
        self._sensors = sensor_poses(parameters)
        offset = parameters.base_offset
        self._offset = Rigid.from_rpy(*offset) if any(offset) else None

    def take(self, message: Any, *, is_static: bool) -> None:
        """Take a TFMessage.

        Raises:
            MessageError: A transform is none.
        """
        for transform in message.transforms:
            at = read_transform(transform)
            self._tree.take(at.parent, at.child, at.stamp, Rigid.of(at), is_static=is_static)

    def locate(self, odometry: Odometry, recorded: int) -> tuple[float, ...]:
        """Return x, y, z [m], roll, pitch, yaw [rad] of the body on the map, and keep the pose.

        Args:
            odometry: The message, in the map's frame or one that transforms connect with it.
            recorded: Time of its recording [ns].

        Raises:
            MessageError: Values that are no pose.
            TransformError: Its frame is not connected with the map's.
        """
        frame = odometry.header.frame_id
        is_linked = frame != self._map and self._tree.knows(frame)
        pose, _ = odometry_to_pose(odometry, frame if is_linked else self._map)
        x, y, z, yaw = pose.tolist()
        found = x, y, z, *odometry_to_tilt(odometry), yaw
        robot, stamp = Rigid.from_rpy(*found), stamp_to_ns(odometry.header.stamp)
        time = recorded if stamp is None else stamp
        if is_linked:
            robot = self._tree.find(self._map, frame, stamp, time).then(robot)
        self._sensors.take(robot, time)
        if not is_linked and self._offset is None:
            return found
        body = robot if self._offset is None else robot.then(self._offset)
        return *body.translation.tolist(), *body.rotation.as_euler("xyz").tolist()

    def locate_path(self, path: Path) -> NDArray[np.float64]:
        """Return (n, 3) x, y [m], yaw [rad] of the body at the poses of a path of the robot.

        Raises:
            MessageError: As `path_to_poses`.
        """
        poses = path_to_poses(path, self._map)
        if self._offset is None:
            return poses
        offset = self._offset
        return np.array([read_pose(stamped.pose).then(offset).xyyaw for stamped in path.poses])

    def locate_pose(self, pose: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return x, y [m], yaw [rad] of the body where the robot is level at such a pose."""
        if self._offset is None:
            return pose
        x, y, yaw = pose
        found = Rigid.from_rpy(x, y, 0.0, 0.0, 0.0, yaw).then(self._offset).xyyaw.tolist()
        return found[0], found[1], found[2]

    def to_base(self, path: Path) -> Path:
        """Change a path of the body into one of the robot, in place, and return it."""
        moved: Path = move_path(path, None if self._offset is None else self._offset.inverse())
        return moved

    def find_source(self, message: Any, topic: str, recorded: int) -> Rigid | None:
        """Return where the frame of a map's message was in the map's; None if it is that.

        Raises:
            MessageError: The message names no frame.
            TransformError: As `SensorPoses.find`.
        """
        frame = message.header.frame_id
        if frame in ("", self._map):
            check_frame(frame, self._map, topic)
            return None
        stamp = stamp_to_ns(message.header.stamp)
        time = recorded if stamp is None else stamp
        return self._sensors.find(frame, stamp, time, self._tree)
