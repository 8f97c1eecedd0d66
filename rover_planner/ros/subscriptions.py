# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that warn of publishers they cannot hear, with the parameter that mends it."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.subscription import Subscription

from rover_planner.ros.node import RoverNode, create_steady_timer
from rover_planner.ros.qos import (
    HEAR_BEST_EFFORT,
    make_qos,
    map_subscriptions,
)
from rover_planner.shell.extras import name_type

PERIOD = 5.0
"""Time between two looks at the types of publishers [s]; one takes a millisecond per topic."""


def subscribe_to_requests(
    node: Node,
    kind: type,
    name: str,
    take: Callable[[Any], None],
    reliability: str,
    *,
    raw: bool = False,
) -> None:
    """Subscribe to a topic of requests, such as paths.

    Args:
        node: The node.
        kind: Type of the messages.
        name: Name of the topic.
        take: Called with each message; it must not raise.
        reliability: One of `RELIABILITIES`.
        raw: Whether `take` gets the bytes of a message.
    """
    qos = make_qos(10, reliability)
    _subscribe(node, kind, name, take, qos, HEAR_BEST_EFFORT, raw=raw)


def subscribe_to_map(
    node: RoverNode[Any], kind: type, name: str, take: Callable[[bytes], object]
) -> None:
    """Subscribe to a topic of maps, whose messages `take` gets as bytes, perhaps twice.

    The rest is as for `subscribe_to_requests`.
    """
    values, spare = node.values, None
    hear: Callable[..., object] = take
    for qos, mends in map_subscriptions(values.map_durability, values.input_reliability):
        heard = _subscribe(node, kind, name, hear, qos, mends, raw=True, group=spare)
        spare = _Spare(heard, take)
        hear = spare.hear


class _Spare(MutuallyExclusiveCallbackGroup):
    """The group of a subscription that is read only if another one does not hear all publishers.

    To read a large map takes Python's lock for long.
    """

    def __init__(self, other: Subscription, take: Callable[[bytes], object]):
        super().__init__()
        self._other, self._take = other, take
        self._idle_until = 0  # ns

    def can_execute(self, entity: Any) -> bool:
        """Return whether there is a publisher that only this subscription hears."""
        if isinstance(entity, Subscription):
            alone = entity.get_publisher_count() > self._other.get_publisher_count()
            if not alone:
                self._idle_until = time.time_ns()
            return alone and bool(super().can_execute(entity))
        return bool(super().can_execute(entity))

    def hear(self, message: bytes, info: Mapping[str, int]) -> None:
        """Take a message, unless it came while the other subscription heard all: it is old."""
        idle_until, self._idle_until = self._idle_until, 0
        if info["received_timestamp"] > idle_until:
            self._take(message)


def _subscribe(
    node: Node,
    kind: type,
    name: str,
    take: Callable[..., object],
    qos: QoSProfile,
    mends: Mapping[QoSPolicyKind, str],
    *,
    raw: bool = False,
    group: CallbackGroup | None = None,
) -> Subscription:
    """Subscribe, and warn of mismatches of the kinds in `mends`; others are expected."""

    def warn(event) -> None:
        mismatch = QoSPolicyKind(event.last_policy_kind)
        if mismatch in mends:
            node.get_logger().warning(
                f"a publisher of {name} is not heard: its {mismatch.name.lower()} does not match; "
                f"{mends[mismatch]}"
            )

    events = SubscriptionEventCallbacks(incompatible_qos=warn, use_default_callbacks=False)
    return node.create_subscription(
        kind, name, take, qos, callback_group=group, event_callbacks=events, raw=raw
    )


class PublisherCheck:
    """Looks for publishers of other types each PERIOD; each problem is logged once."""

    def __init__(self, node: Node, kinds: Mapping[str, type], mends: Mapping[type, str]):
        """Check topics of a node.

        Args:
            node: The node.
            kinds: Type of the messages of each topic.
            mends: What to do about publishers of other types, by type.
        """
        self._node = node
        self._types = {topic: name_type(kind) for topic, kind in kinds.items()}
        self._mends = {name_type(kind): mend for kind, mend in mends.items()}
        self.problems: tuple[str, ...] = ()
        """The problems found last."""
        create_steady_timer(node, PERIOD, self._check)

    def _check(self) -> None:
        before = self.problems
        self.problems = tuple(
            problem for topic in self._types for problem in self._find_problems(topic)
        )
        for problem in self.problems:
            if problem not in before:
                self._node.get_logger().warning(problem)

    def _find_problems(self, topic: str) -> list[str]:
        """Return the problems of a topic's publishers, each once."""
        wanted, found = self._types[topic], []
        for publisher in self._node.get_publishers_info_by_topic(topic):
            kind = publisher.topic_type
            if kind == wanted:
                continue
            name = f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
            mend = self._mends.get(kind, f"it must be {wanted}")
            found.append(f"{topic} of {name} is not heard: its type is {kind}; {mend}")
        return list(dict.fromkeys(found))
