# SPDX-License-Identifier: Apache-2.0
"""Warns of publishers that a subscription cannot hear, with the parameter that mends it."""

from collections.abc import Mapping

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind


def warn_of_mismatch(
    node: Node, topic: str, parameters: Mapping[QoSPolicyKind, str]
) -> SubscriptionEventCallbacks:
    """Return event callbacks of a subscription that warn of publishers it does not match.

    Args:
        node: The node, for its log.
        topic: Name of the topic.
        parameters: By kind of mismatch, what to do about it, such as "set input_reliability to
            best_effort". Kinds that are missing are expected, and ignored.
    """

    def warn(event) -> None:
        kind = QoSPolicyKind(event.last_policy_kind)
        advice = parameters.get(kind)
        if advice is not None:
            node.get_logger().warning(
                f"a publisher of {topic} is not heard: its {kind.name.lower()} does not match; "
                f"{advice}"
            )

    return SubscriptionEventCallbacks(incompatible_qos=warn, use_default_callbacks=False)
