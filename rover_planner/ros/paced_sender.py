# SPDX-License-Identifier: Apache-2.0
"""Sends many responses in small groups, so that clients have time to take them."""

import time
from collections import deque
from collections.abc import Callable

from rclpy.node import Node

from rover_planner.ros.guard import Guard
from rover_planner.ros.steady import create_steady_timer

AT_ONCE = 5
"""Largest number of responses in a group."""
PAUSE = 0.01
"""Time for one group [s]."""


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
