# SPDX-License-Identifier: Apache-2.0
"""The frames of a node, which hears of them on /tf and /tf_static."""

from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from msg_adapters.errors import MessageError
from rover_planner.planning.navigation.sensor_mounts import SensorPoses
from rover_planner.ros.frames import FrameParameters, Frames
from rover_planner.ros.optional_types import find_type

TF_DEPTH = 100
"""Messages of /tf that wait to be taken, as in tf2."""
TF_MESSAGE = "tf2_msgs.msg:TFMessage"


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
