# SPDX-License-Identifier: Apache-2.0
"""The frames of a node that also places clouds of sensors on the map."""

from nav_msgs.msg import Odometry
from rclpy.node import Node

from msg_adapters.stamps import stamp_to_ns
from rover_planner.nodes.navigation.frames import Frames
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.sensor_mounts import sensor_poses
from rover_planner.planning.navigation.transforms import Rigid, TransformError, read_pose


class SensorFrames(Frames):
    """Frames, and where sensors are by their mounts, /tf or odometry."""

    def __init__(self, node: Node, parameters: TraverseServerParameters):
        """See `Frames`.

        Raises:
            PlanningError: The parameter sensor_mounts is wrong.
        """
        super().__init__(node, parameters)
        self._sensors = sensor_poses(parameters)

    def apply_timeout(self, timeout: float) -> None:
        """Take the age from which transforms, and odometry for clouds, are refused [s]."""
        super().apply_timeout(timeout)
        self._sensors.timeout = timeout

    def find_sensor(self, frame: str, stamp: int | None) -> Rigid:
        """Return where a sensor's frame was in the map frame at a time [ns]; None is the newest.

        Any thread may call it.

        Raises:
            TransformError: As `SensorPoses.find`.
        """
        try:
            return self._sensors.find(frame, stamp, self._now(), self._tree)
        except TransformError as error:
            raise TransformError(f"{error}{self.silence}") from None

    def take_odometry(self, odometry: Odometry) -> None:
        """Keep the pose of the body that odometry in the map frame tells, for the sensors."""
        stamp = stamp_to_ns(odometry.header.stamp)
        body = read_pose(odometry.pose.pose)
        robot = body if self._offset is None else body.then(self._offset.inverse())
        self._sensors.take(robot, self._now() if stamp is None else stamp)
