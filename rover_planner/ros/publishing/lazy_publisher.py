# SPDX-License-Identifier: Apache-2.0
"""A publisher that makes its messages only if the topic has subscribers."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from rover_planner.ros.publishing.latched_publisher import LatchedPublisher


class LazyPublisher:
    """Publishes messages to subscribers; without any, keeps the function that makes the latest."""

    def __init__(self, node: Node, kind: type, name: str, qos: QoSProfile | None = None):
        self._publisher = LatchedPublisher(node, kind, name, qos)
        self._make: Callable[[], Any] | None = None

    @property
    def is_awaited(self) -> bool:
        """Whether a subscriber has not received the latest message."""
        return self._make is not None and self._publisher.has_listeners

    def publish(self, make: Callable[[], Any]) -> None:
        """Publish the message that `make` returns, now or when the first subscriber arrives."""
        self._make = make
        self.catch_up()
        if self._make is not None:
            self._publisher.withdraw()

    def catch_up(self) -> None:
        """Publish the latest message if a subscriber waits for it."""
        make = self._make
        if make is not None and self.is_awaited:
            self._make = None
            self._publisher.publish(make())
