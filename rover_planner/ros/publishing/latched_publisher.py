# SPDX-License-Identifier: Apache-2.0
"""A publisher whose last message reaches late subscribers, and no message that is out of date."""

from functools import partial
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from rover_planner.ros.qos import latched_qos


class LatchedPublisher:
    """Publishes messages that late subscribers get, until they are withdrawn.

    DDS keeps what was published. Where a newer message is not published because nobody listens,
    the old one must go, or `ros2 topic echo --once` shows an answer to an earlier question.
    """

    def __init__(self, node: Node, kind: type, name: str, qos: QoSProfile | None = None):
        # A profile that is transient local and reliable matches every subscription: no mismatch is
        # possible. Its event handler would cost a quarter of a millisecond per request.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        self._node = node
        self._create = partial(
            node.create_publisher, kind, name, qos or latched_qos(), event_callbacks=silent
        )
        self._publisher: Publisher = self._create()
        self._holds = False

    @property
    def has_listeners(self) -> bool:
        """Whether there is a subscriber."""
        return self._publisher.get_subscription_count() > 0

    def publish(self, message: Any) -> None:
        """Publish a message."""
        self._holds = True
        self._publisher.publish(message)

    def withdraw(self) -> None:
        """Keep what was published from late subscribers; only a new publisher forgets it."""
        if self._holds:
            self._holds = False
            self._node.destroy_publisher(self._publisher)
            self._publisher = self._create()
