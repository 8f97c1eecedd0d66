"""What a node does after it has answered a request, so that nobody waits for it."""

import traceback
from collections import deque
from collections.abc import Callable

from rclpy.node import Node


class Afterwards:
    """Runs work in the order it was put off, as soon as the callback that put it off is over.

    The executor sends the response of a service when its callback returns; what the callback puts
    off runs after that, before the next request is looked at.
    """

    def __init__(self, node: Node):
        self._node = node
        self._work: deque[Callable[[], None]] = deque()
        self._due = node.create_guard_condition(self._run)

    def do(self, work: Callable[[], None]) -> None:
        """Put off some work; where it fails the log says so."""
        self._work.append(work)
        self._due.trigger()

    def _run(self) -> None:
        while self._work:
            try:
                self._work.popleft()()
            except Exception:
                # A fault of this program must not leave the rover without a planner.
                self._node.get_logger().error(traceback.format_exc())
