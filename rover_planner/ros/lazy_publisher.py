"""A publisher that makes its messages only if the topic has subscribers."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile

from rover_planner.ros.qos import result_qos


class LazyPublisher:
    """Publishes messages to subscribers; without any, keeps the function that makes the latest."""

    def __init__(self, node: Node, kind: type, name: str, qos: QoSProfile | None = None):
        # A profile that is transient local and reliable matches every subscription: no mismatch is
        # possible. Its event handler would cost a quarter of a millisecond per request.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        self._publisher = node.create_publisher(
            kind, name, qos or result_qos(), event_callbacks=silent
        )
        self._make: Callable[[], Any] | None = None

    @property
    def is_awaited(self) -> bool:
        """Whether a subscriber has not received the latest message."""
        return self._make is not None and self._publisher.get_subscription_count() > 0

    def publish(self, make: Callable[[], Any]) -> None:
        """Publish the message that `make` returns, now or when the first subscriber arrives."""
        self._make = make
        self.catch_up()

    def catch_up(self) -> None:
        """Publish the latest message if a subscriber waits for it."""
        make = self._make
        if make is not None and self.is_awaited:
            self._make = None
            self._publisher.publish(make())
