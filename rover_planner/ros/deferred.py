# SPDX-License-Identifier: Apache-2.0
"""Responses that a service sends later than its callback returns, and not too many at once."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from rover_planner.ros.guard import Guard
from rover_planner.ros.node import create_steady_timer
from rover_planner.ros.qos import SERVICE_QOS

AT_ONCE = 5
"""Largest number of responses in a group."""
PAUSE = 0.01
"""Time for one group [s]."""

Reply = Callable[[Any], None]
"""Function that sends a response; called once per request, in the executor's thread."""


def serve_later(
    node: Node, kind: type, name: str, take: Callable[[Any, Any, Reply], None]
) -> None:
    """Create a service that takes requests without a response.

    Args:
        node: The node.
        kind: Type of the service.
        name: Name of the service.
        take: Called with the request, an empty response, and the function that sends it when it
            is filled.
    """

    def hand_on(request: Any, response: Any) -> tuple[Any, Any]:
        return request, response

    service = node.create_service(kind, name, hand_on, qos_profile=SERVICE_QOS)
    send_response = service.send_response

    def receive(exchange: tuple[Any, Any], header: Any) -> None:
        take(*exchange, lambda response: send_response(response, header))

    # rclpy sends what a callback returns, together with the header of the request; coroutines
    # would keep its executor busy while they wait.
    setattr(service, "send_response", receive)  # noqa: B010, a method that is replaced


class PacedSender:
    """Calls functions in order, at most AT_ONCE in each PAUSE; a few of them at once.

    ROS sends each response to all clients of a service, and a client keeps only ten by default.
    If fifty are sent at once, clients lose responses that are theirs.
    """

    def __init__(self, node: Node, guard: Guard):
        self._guard = guard
        self._waiting: deque[Callable[[], None]] = deque()
        self._begin, self._count = 0.0, 0
        self._timer = create_steady_timer(node, PAUSE, self._send_group, starts=False)

    def send(self, function: Callable[[], None]) -> None:
        """Call a function that sends a response, now or soon."""
        self._waiting.append(function)
        if len(self._waiting) == 1:
            self._send_group()

    def send_all(self) -> None:
        """Call all functions that wait, such as before the node ends."""
        while self._waiting:
            self._send_next()

    def _send_group(self) -> None:
        now = time.monotonic()
        if now - self._begin >= PAUSE:
            self._begin, self._count = now, 0
        while self._waiting and self._count < AT_ONCE:
            self._send_next()
        if self._waiting:
            self._timer.reset()
        else:
            self._timer.cancel()

    def _send_next(self) -> None:
        self._count += 1
        self._guard.call(self._waiting.popleft())
