# SPDX-License-Identifier: Apache-2.0
"""What a node does later, so that answers are not delayed: responses, and work after these."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from rover_planner.ros.guard import Guard
from rover_planner.ros.node import create_steady_timer
from rover_planner.ros.qos import service_qos

QUIET = 0.03
"""Time after the last answer before the work begins [s]: a client has time to read the answer
and to send its next request."""
SLICE = 0.002
"""Time for which work runs before it pauses for requests [s]."""
GAP = 0.003
"""Length of this pause [s]."""
MAX_WAITING = 4
"""Largest number of answers whose work may be pending."""
AT_ONCE = 5
"""Largest number of responses in a group."""
PAUSE = 0.01
"""Time for one group [s]."""

Work = Callable[[], None]
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

    service = node.create_service(kind, name, hand_on, qos_profile=service_qos())
    send_response = service.send_response

    def receive(exchange: tuple[Any, Any], header: Any) -> None:
        take(*exchange, lambda response: send_response(response, header))

    # rclpy sends what a callback returns, together with the header of the request; coroutines
    # would keep its executor busy while they wait.
    setattr(service, "send_response", receive)  # noqa: B010, a method that is replaced


class DeferredWork:
    """Runs deferred work in order, piece by piece; requests have priority.

    A timer runs the pieces, and each further answer restarts it. A request therefore waits for at
    most one SLICE plus the piece that exceeds it. During continuous requests the work of at most
    MAX_WAITING answers is pending: beyond that, all work of the oldest answer is done before the
    next request. No work is skipped and the order is kept.
    """

    def __init__(self, node: Node, guard: Guard):
        self._guard = guard
        self._answers: deque[deque[Work]] = deque()
        self._timer = create_steady_timer(node, QUIET, self._run_some, starts=False)
        self._too_many = node.create_guard_condition(self._run_oldest)

    def do(self, *pieces: Work) -> None:
        """Defer the work of one answer; `guard` takes errors of its pieces."""
        self._answers.append(deque(pieces))
        self._wait(QUIET)
        if len(self._answers) > MAX_WAITING:
            self._too_many.trigger()

    def _run_some(self) -> None:
        """Run pieces for about one SLICE."""
        end = time.perf_counter() + SLICE
        while self._answers and time.perf_counter() < end:
            self._run_next()
        if self._answers:
            self._wait(GAP)
        else:
            self._timer.cancel()

    def _wait(self, seconds: float) -> None:
        self._timer.timer_period_ns = round(1e9 * seconds)
        self._timer.reset()

    def _run_oldest(self) -> None:
        """Run the work of the oldest answers until at most MAX_WAITING answers are pending."""
        while len(self._answers) > MAX_WAITING:
            self._run_next()

    def _run_next(self) -> None:
        """Run the next piece of the oldest answer."""
        pieces = self._answers[0]
        if pieces:
            self._guard.call(pieces.popleft())
        if not pieces:
            self._answers.popleft()


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
