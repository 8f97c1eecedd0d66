# SPDX-License-Identifier: Apache-2.0
"""The publishers of the traction controller."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Bool, Float64MultiArray, String

from msg_adapters.commands import effort_commands, labelled_array, set_values
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.ros.qos import latched_qos, topic_qos
from rover_planner.traction.traction_service import TractionUpdate

STANDING_WHEELS = np.zeros(WHEEL_COUNT)
"""Rates of wheels that stand [rad/s]."""


class TractionTopics:
    """Publishers of commands, state, brake and forces; each thread has messages of its own."""

    def __init__(self, node: Node, order: NDArray[np.int64], signs: Floats):
        """Create the publishers.

        Args:
            node: The node.
            order: (6,) index of the wheel of each value of ~/commands.
            signs: (6,) sign of the torque of each wheel in messages, in wheel order.
        """
        qos = topic_qos()
        self.commands = node.create_publisher(Float64MultiArray, "~/commands", qos)
        self.velocities = node.create_publisher(Float64MultiArray, "~/velocity_commands", qos)
        self.steering = node.create_publisher(Float64MultiArray, "~/steering_commands", qos)
        self.brake = node.create_publisher(Bool, "~/brake", latched_qos())
        self.state = node.create_publisher(String, "~/state", latched_qos())
        self.diagnostics = node.create_publisher(DiagnosticArray, "diagnostics", qos)
        self._loads = node.create_publisher(Float64MultiArray, "~/wheel_loads", qos)
        self._used = node.create_publisher(Float64MultiArray, "~/friction_utilisation", qos)
        self._angles = node.create_publisher(Float64MultiArray, "~/contact_angles", qos)
        self.last_state: tuple[str, bool] | None = None
        """State and brake published last."""
        # Messages are reused, which is safe because publishing copies them.
        zeros = np.zeros(WHEEL_COUNT)
        self._contacts = np.zeros((2, WHEEL_COUNT))
        self._of_wheels = labelled_array(zeros, "wheel")
        self._of_contacts = labelled_array(self._contacts, "angle, deviation", "wheel")
        self.writer = CommandWriter(self, order, signs)
        """For the thread of the updates."""
        self.watchdog_writer = CommandWriter(self, order, signs)
        """For the thread of the watchdog."""

    def publish_steering(self, angles: Floats) -> None:
        """Publish angles [rad] of the steered wheels as messages have them, in wheel order."""
        self.steering.publish(Float64MultiArray(data=angles.tolist()))

    def publish_forces(self, update: TractionUpdate) -> None:
        """Publish loads, utilisation and contact angles of an update that has them."""
        estimate, answer = update.estimate, update.answer
        if estimate is None or answer is None:
            return
        for publisher, values in ((self._loads, answer.loads), (self._used, answer.utilisation)):
            set_values(self._of_wheels, values)
            publisher.publish(self._of_wheels)
        self._contacts[0] = estimate.angles
        np.sqrt(estimate.covariance.diagonal(), out=self._contacts[1])
        set_values(self._of_contacts, self._contacts)
        self._angles.publish(self._of_contacts)


class CommandWriter:
    """Publishes commands with messages of its own, so that threads share none."""

    def __init__(self, topics: TractionTopics, order: NDArray[np.int64], signs: Floats):
        """Write to the publishers of `topics`; the rest is as there."""
        self._topics, self._order, self._signs = topics, order, signs[order]
        self._efforts = effort_commands(np.zeros(WHEEL_COUNT), order)
        self._rates = effort_commands(np.zeros(WHEEL_COUNT), order)
        self._brake, self._state = Bool(), String()

    def write(
        self, torques: Floats, brake: bool, state: str, rates: Floats = STANDING_WHEELS
    ) -> None:
        """Publish torques (6,) [N m] and rates (6,) [rad/s]; brake and state if changed."""
        topics = self._topics
        if topics.velocities.get_subscription_count():
            set_values(self._rates, self._signs * rates[self._order])
            topics.velocities.publish(self._rates)
        set_values(self._efforts, self._signs * torques[self._order])
        topics.commands.publish(self._efforts)
        if topics.last_state == (state, brake):
            return
        topics.last_state = state, brake
        self._brake.data, self._state.data = brake, state
        topics.brake.publish(self._brake)
        topics.state.publish(self._state)
