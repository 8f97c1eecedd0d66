# SPDX-License-Identifier: Apache-2.0
"""The publishers of the traction controller."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, Float64MultiArray, String

from msg_adapters.commands import doubles, labelled_array
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.ros.qos import LATCHED_QOS, TOPIC_QOS
from rover_planner.traction.traction_service import TractionCommand

STANDING_WHEELS = np.zeros(WHEEL_COUNT)
"""Rates of wheels that stand [rad/s]."""


class TractionTopics:
    """Publishers of commands, state, brake and forces; any thread may write commands."""

    def __init__(self, node: Node, order: NDArray[np.int64], signs: Floats):
        """Create the publishers.

        Args:
            node: The node.
            order: (6,) index of the wheel of each value of ~/commands.
            signs: (6,) sign of the torque of each wheel in messages, in wheel order.
        """

        def publish(name: str) -> Publisher:
            return node.create_publisher(Float64MultiArray, name, TOPIC_QOS)

        self._order, self._signs = order, signs[order]
        self.commands = publish("~/commands")
        self.velocities = publish("~/velocity_commands")
        self.steering = publish("~/steering_commands")
        self.brake = node.create_publisher(Bool, "~/brake", LATCHED_QOS)
        self.state = node.create_publisher(String, "~/state", LATCHED_QOS)
        self.diagnostics = node.create_publisher(DiagnosticArray, "diagnostics", TOPIC_QOS)
        self._loads = publish("~/wheel_loads")
        self._used = publish("~/friction_utilisation")
        self._angles = publish("~/contact_angles")
        self._last_state: tuple[str, bool] | None = None

    def write(
        self, torques: Floats, brake: bool, state: str, rates: Floats = STANDING_WHEELS
    ) -> None:
        """Publish torques (6,) [N m] and rates (6,) [rad/s]; brake and state if changed."""
        if self.velocities.get_subscription_count():
            self.velocities.publish(self._to_message(rates))
        self.commands.publish(self._to_message(torques))
        if self._last_state != (state, brake):
            told = self._last_state = state, brake
            self.brake.publish(Bool(data=brake))
            self.state.publish(String(data=state))
            if self._last_state is not told:  # another thread wrote meanwhile: which came last?
                self._last_state = None

    def _to_message(self, values: Floats) -> Float64MultiArray:
        """Return values of the wheels (6,) in the order and with the signs of messages."""
        return Float64MultiArray(data=doubles(self._signs * values[self._order]))

    def publish_steering(self, angles: Floats) -> None:
        """Publish angles [rad] of the steered wheels as messages have them, in wheel order."""
        self.steering.publish(Float64MultiArray(data=doubles(angles)))

    def publish_forces(self, command: TractionCommand) -> None:
        """Publish loads, utilisation and contact angles of a rover that drives, to who listens."""
        estimate, answer = command.estimate, command.answer
        if estimate is None or answer is None:
            return
        for publisher, values in ((self._loads, answer.loads), (self._used, answer.utilisation)):
            if publisher.get_subscription_count():
                publisher.publish(labelled_array(values, "wheel"))
        if self._angles.get_subscription_count():
            deviations = np.sqrt(estimate.covariance.diagonal())
            contacts = np.array([estimate.angles, deviations])
            self._angles.publish(labelled_array(contacts, "angle, deviation", "wheel"))
