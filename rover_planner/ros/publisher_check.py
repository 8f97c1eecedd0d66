# SPDX-License-Identifier: Apache-2.0
"""Warns of publishers of another type than a node's subscription, which cannot be heard."""

from collections.abc import Mapping
from dataclasses import dataclass

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

PERIOD = 1.0
"""Time between two looks at the publishers [s]."""


@dataclass(frozen=True)
class ExpectedType:
    """What a node hears on a topic, and how to hear something else."""

    name: str
    """Type of the messages, such as geometry_msgs/msg/Twist."""
    advice: Mapping[str, str]
    """What to do about publishers of other types, by type."""


class PublisherCheck:
    """Looks at the publishers of topics once a second; each problem is logged once."""

    def __init__(self, node: Node, topics: Mapping[str, ExpectedType]):
        """Check topics of a node by name."""
        self._node, self._topics = node, dict(topics)
        self._told: set[str] = set()
        self.problems: tuple[str, ...] = ()
        """The problems found last."""
        node.create_timer(PERIOD, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _check(self) -> None:
        self.problems = tuple(
            problem for topic in self._topics for problem in self._find_problems(topic)
        )
        for problem in self.problems:
            if problem not in self._told:
                self._node.get_logger().warning(problem)
        self._told = set(self.problems)

    def _find_problems(self, topic: str) -> list[str]:
        """Return the problems of a topic's publishers, each once."""
        wanted, found = self._topics[topic], []
        for publisher in self._node.get_publishers_info_by_topic(topic):
            kind = publisher.topic_type
            if kind == wanted.name:
                continue
            name = f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
            advice = wanted.advice.get(kind, f"it must be {wanted.name}")
            found.append(f"{topic} of {name} is not heard: its type is {kind}; {advice}")
        return list(dict.fromkeys(found))
