# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to requests, such as paths: reliable, and loud about publishers not heard."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from rover_planner.parameters.shared import BEST_EFFORT
from rover_planner.ros.qos import RELIABILITY, input_qos
from rover_planner.ros.qos_warnings import warn_of_mismatch


def subscribe_to_requests(
    node: Node, kind: type, name: str, take: Callable[[Any], None], reliability: str
) -> None:
    """Subscribe to a topic of requests.

    Args:
        node: The node.
        kind: Type of the messages.
        name: Name of the topic.
        take: Called with each message; it must not raise.
        reliability: One of `RELIABILITIES`.
    """
    mends = {RELIABILITY: f"set input_reliability to {BEST_EFFORT}, or publish it reliably"}
    events = warn_of_mismatch(node, name, mends)
    node.create_subscription(kind, name, take, input_qos(reliability), event_callbacks=events)
