"""A topic of results whose messages are made only when somebody listens."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from rover_planner.ros.qos import result_qos


class LazyPublisher:
    """Publishes what somebody listens to; else keeps how to make the latest for whoever comes."""

    def __init__(self, node: Node, kind: type, name: str):
        # These topics offer as much as a subscription may ask for, so there is no mismatch to
        # warn of; to look out for one on each would cost every request a quarter of a millisecond.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        self._publisher = node.create_publisher(kind, name, result_qos(), event_callbacks=silent)
        self._make: Callable[[], Any] | None = None

    @property
    def is_awaited(self) -> bool:
        """Whether somebody listens who has not got the latest message."""
        return self._make is not None and self._publisher.get_subscription_count() > 0

    def publish(self, make: Callable[[], Any]) -> None:
        """Publish the message that `make` returns, now or when the first listener comes."""
        self._make = make
        self.catch_up()

    def catch_up(self) -> None:
        """Publish the latest message if somebody waits for it."""
        make = self._make
        if make is not None and self.is_awaited:
            self._make = None
            self._publisher.publish(make())
