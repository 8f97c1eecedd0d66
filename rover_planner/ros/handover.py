# SPDX-License-Identifier: Apache-2.0
"""Hands functions from other threads to the executor's thread of a node."""

import contextlib
from collections import deque
from collections.abc import Callable

from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from rover_planner.ros.guard import Guard


class Handover:
    """Calls functions in the executor's thread, in order."""

    def __init__(self, node: Node, guard: Guard):
        self._waiting: deque[Callable[[], object]] = deque()
        self._ready = node.create_guard_condition(self._call_all)
        self._guard = guard

    def call(self, function: Callable[[], object]) -> None:
        """Call a function soon in the executor's thread; any thread may ask for it."""
        self._waiting.append(function)
        with contextlib.suppress(InvalidHandle):  # the node is gone, and with it who waits
            self._ready.trigger()

    def _call_all(self) -> None:
        while self._waiting:
            self._guard.call(self._waiting.popleft())
