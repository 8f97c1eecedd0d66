# SPDX-License-Identifier: Apache-2.0
"""Topics that a node reads when it needs what they say, so that no message wakes it.

Each wake-up of rclpy's executor puts all entities of the node into a new wait set, which takes
longer than most messages do.
"""

import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from msg_adapters.raw_messages import READERS, read_raw
from msg_adapters.stamps import NANOSECONDS
from rover_physics.errors import RoverError
from rover_planner.ros.guard import Guard
from rover_planner.ros.logs import RepeatLog

Take = Callable[[Any, float], object]
"""Takes a message and the time of its arrival [s], monotonic; may raise."""
Refuse = Callable[[str, Exception, float], object]
"""Takes the name of a topic, what `Take` has raised of a message, and when that came [s]."""


class PolledTopics:
    """Subscriptions of a node that are read by `poll`, in the executor's thread."""

    def __init__(self, node: Node, guard: Guard):
        """Begin without topics; `guard` takes unexpected errors."""
        self._node, self._guard, self._group = node, guard, _Apart()
        self._topics: list[tuple[Subscription, Refuse]] = []
        self._polled = time.monotonic()
        self._refusals = RepeatLog()

    def subscribe(
        self,
        kind: type,
        name: str,
        take: Take,
        qos: QoSProfile,
        refuse: Refuse | None = None,
    ) -> None:
        """Subscribe to a topic.

        Args:
            kind: Type of the messages; those of READERS are read by `read_raw`.
            name: Name of the topic.
            take: Called with each message.
            qos: The profile; of more messages than its depth the last ones are read.
            refuse: Called if `take` raises; None has that logged.
        """
        topic = self._node.create_subscription(
            kind, name, take, qos, callback_group=self._group, raw=kind in READERS
        )
        self._topics.append((topic, refuse or self._refuse))

    def poll(self) -> None:
        """Read all that has come since the last time, in the order of its arrival."""
        before, self._polled = self._polled, time.monotonic()
        arrived = [
            (*found, topic, refuse)
            for topic, refuse in self._topics
            for found in self._take(topic)
        ]
        for at, found, topic, refuse in sorted(arrived, key=lambda one: one[0]):
            # Since the last poll at most, whatever the system clock was set to meanwhile.
            age, now = (time.time_ns() - at) / NANOSECONDS, time.monotonic()
            arrival = now - min(max(age, 0.0), now - before)
            try:
                message = read_raw(found, topic.msg_type) if topic.raw else found
                topic.callback(message, arrival)
            except Exception as error:
                refuse(topic.topic, error, arrival)

    def _take(self, topic: Subscription) -> list[tuple[int, Any]]:
        """Return what has come, each after its time [ns]."""
        arrived = []
        for _ in range(topic.qos_profile.depth):
            try:
                with topic.handle:
                    found = topic.handle.take_message(topic.msg_type, topic.raw)
            except Exception as error:
                self._guard.report(f"reading of {topic.topic}", error)
                continue
            if found is None:
                break
            arrived.append((found[1]["received_timestamp"], found[0]))
        return arrived

    def _refuse(self, name: str, error: Exception, now: float) -> None:
        """Log why a message is not used, those of one kind once in a while."""
        if not isinstance(error, RoverError):
            self._guard.report(f"reading of {name}", error)
            return
        line = self._refusals.line(f"{name} not used: {error}", now)
        if line:
            self._node.get_logger().warning(line)


class _Apart(CallbackGroup):
    """A group that executors leave alone."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass
