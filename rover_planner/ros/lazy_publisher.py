# SPDX-License-Identifier: Apache-2.0
"""A publisher that makes messages only for subscribers, and of which nobody hears an old one."""

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher

from rover_planner.ros.qos import LATCHED_QOS


class LazyPublisher:
    """Publishes messages to subscribers; without any, keeps the function that makes the latest.

    DDS keeps what was published for late subscribers. Where a newer message is not published
    because nobody listens, the old one must go, or `ros2 topic echo --once` shows an answer to an
    earlier question.
    """

    def __init__(self, node: Node, kind: type, name: str):
        # A profile that is transient local and reliable matches every subscription: no mismatch is
        # possible. Its event handler would cost a quarter of a millisecond per request.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        self._node = node
        self._create = partial(
            node.create_publisher, kind, name, LATCHED_QOS, event_callbacks=silent
        )
        self._publisher: Publisher = self._create()
        self._make: Callable[[], Any] | None = None
        self._holds = False

    @property
    def has_listeners(self) -> bool:
        """True if there is a subscriber."""
        return self._publisher.get_subscription_count() > 0

    def publish(self, make: Callable[[], Any]) -> None:
        """Publish the message that `make` returns, now or when the first subscriber arrives."""
        self._make = make
        self.catch_up()
        if self._make is not None:
            self.withdraw()

    def catch_up(self) -> None:
        """Publish the latest message if a subscriber waits for it."""
        make = self._make
        if make is not None and self.has_listeners:
            self._make = None
            self.send(make())

    def send(self, message: Any) -> None:
        """Publish a message that is made, whether or not there is a subscriber."""
        self._holds = True
        self._publisher.publish(message)

    def withdraw(self) -> None:
        """Keep what was published from late subscribers; only a new publisher forgets it."""
        if self._holds:
            self._holds = False
            self._node.destroy_publisher(self._publisher)
            self._publisher = self._create()
