# SPDX-License-Identifier: Apache-2.0
"""Topics that a node reads when it needs what they say, so that no message wakes it.

Each wake-up of rclpy's executor puts all entities of the node into a new wait set, which takes
longer than most messages do.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from msg_adapters.stamps import NANOSECONDS
from rover_planner.ros.guard import Guard


@dataclass(frozen=True)
class _Topic:
    """A topic that is polled."""

    subscription: Subscription
    name: str
    take: Callable[[Any, float], None]
    depth: int
    is_due: Callable[[], bool]


class PolledTopics:
    """Subscriptions of a node that are read by `poll`, in the executor's thread."""

    def __init__(self, node: Node, guard: Guard):
        """Begin without topics; `guard` takes unexpected errors."""
        self._node, self._guard, self._group = node, guard, _Apart()
        self._topics: list[_Topic] = []
        self._polled = time.monotonic()

    def subscribe(
        self,
        kind: type,
        name: str,
        take: Callable[[Any, float], None],
        qos: QoSProfile,
        is_due: Callable[[], bool] = lambda: True,
        *,
        raw: bool = False,
    ) -> None:
        """Subscribe to a topic.

        Args:
            kind: Type of the messages.
            name: Name of the topic.
            take: Called with each message and the time of its arrival [s], monotonic.
            qos: The profile; of more messages than its depth the last ones are read.
            is_due: Whether it is to be read at all now.
            raw: Whether `take` gets the bytes of a message: to make the message takes long.
        """
        group = self._group
        topic = self._node.create_subscription(
            kind, name, take, qos, callback_group=group, raw=raw
        )
        self._topics.append(_Topic(topic, topic.topic_name, take, qos.depth, is_due))

    def poll(self) -> None:
        """Read all that has come since the last time, in the order of its arrival."""
        before, self._polled = self._polled, time.monotonic()
        arrived = []
        for topic in self._topics:
            if topic.is_due():
                arrived += self._read(topic)
        for at, name, take, message in sorted(arrived, key=lambda one: one[0]):
            # Since the last poll at most, whatever the system clock was set to meanwhile.
            age, now = (time.time_ns() - at) / NANOSECONDS, time.monotonic()
            try:
                take(message, now - min(max(age, 0.0), now - before))
            except Exception as error:
                self._guard.report(f"reading of {name}", error)

    def _read(self, topic: _Topic) -> list[tuple[int, str, Callable[[Any, float], None], Any]]:
        """Return what has come with its time [ns], the name of the topic and who takes it."""
        one, arrived = topic.subscription, []
        for _ in range(topic.depth):
            try:
                with one.handle:
                    found = one.handle.take_message(one.msg_type, one.raw)
            except Exception as error:
                self._guard.report(f"reading of {topic.name}", error)
                continue
            if found is None:
                break
            arrived.append((found[1]["received_timestamp"], topic.name, topic.take, found[0]))
        return arrived


class _Apart(CallbackGroup):
    """A group that executors leave alone."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass
