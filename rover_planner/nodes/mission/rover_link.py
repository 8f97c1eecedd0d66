# SPDX-License-Identifier: Apache-2.0
"""The link to the rover: paths to its follower, and what is heard of its drive."""

import contextlib
from collections.abc import Callable

import numpy as np
from nav_msgs.msg import Odometry, Path
from rclpy.publisher import Publisher
from std_msgs.msg import String

from msg_adapters.errors import MessageError
from msg_adapters.identity import path_hash
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.paths import poses_path
from rover_physics.numerics.arrays import Floats
from rover_planner.errors import DriveFailedError
from rover_planner.nodes.mission.server_client import NoAnswerError, ServerClient
from rover_planner.ros.qos import LATCHED_QOS, SENSOR_QOS, TOPIC_QOS


class RoverLink:
    """Sends a rover paths, unless another node does, and hears where it is."""

    def __init__(self, node: ServerClient):
        """Subscribe to what the rover tells."""
        self._node = node
        self._pose: np.ndarray | None = None
        self._sent = self._driven = ""
        self._paths: Publisher | None = None
        self._own_paths: set[str] = set()
        self._other_path = False
        node.create_subscription(Odometry, "odometry", self._take_odometry, SENSOR_QOS)
        driven = node.create_subscription(String, "path_driven", self._take_driven, LATCHED_QOS)
        self._driven_topic = driven.topic_name

    def send_path(self, poses: Floats) -> None:
        """Let the rover follow a path of poses (n, 3), x, y [m] and yaw [rad], map frame.

        Raises:
            NoAnswerError: Another node sends paths, or none subscribes to them, for all the time.
        """
        paths = self._paths or self._take_rover()
        # One of those who hear it is this node.
        self._node.wait(lambda: paths.get_subscription_count() > 1, "a rover on the topic path")
        path = poses_path(poses, self._node.frame)
        self._sent, self._driven = path_hash(path), ""
        self._own_paths.add(self._sent)
        paths.publish(path)

    def _take_rover(self) -> Publisher:
        """Return the publisher of paths, once no other node publishes any."""
        node, topic = self._node, self._node.resolve_topic_name("path")
        others = ", ".join(one.node_name for one in node.get_publishers_info_by_topic(topic))
        if others:
            node.get_logger().warning(f"waiting: {others} sends the rover paths")
        node.wait(
            lambda: not node.count_publishers(topic),
            f"the end of {others}, which sends the rover paths",
        )
        node.create_subscription(Path, "path", self._hear_path, TOPIC_QOS)
        self._paths = node.create_publisher(Path, "path", TOPIC_QOS)
        return self._paths

    def _hear_path(self, path: Path) -> None:
        self._other_path |= path_hash(path) not in self._own_paths

    def has_ended(self) -> bool | None:
        """Return whether the follower is at the end of the path; None if it never says so."""
        if not self._node.count_publishers(self._driven_topic):
            return None
        return self._driven == self._sent

    def wait_for_pose(self, is_wanted: Callable[[Floats], bool], seconds: float) -> Floats:
        """Return the first measured pose (3,) that is wanted, or the last one after some seconds.

        Raises:
            NoAnswerError: No pose was measured in time.
            DriveFailedError: Another node has sent the rover a path.
        """
        if self._other_path:
            raise DriveFailedError("another node has sent the rover a path, and drives it now")
        self._node.wait(lambda: self._pose is not None, "odometry")
        with contextlib.suppress(NoAnswerError):
            self._node.wait(lambda: is_wanted(np.array(self._pose)), "the rover", seconds)
        return np.array(self._pose)

    def _take_odometry(self, odometry: Odometry) -> None:
        try:
            pose, _ = odometry_to_pose(odometry, self._node.frame)
        except MessageError as error:
            self._node.get_logger().warning(f"odometry not used: {error}", once=True)
            return
        self._pose = pose[[0, 1, 5]]

    def _take_driven(self, message: String) -> None:
        self._driven = message.data
