# SPDX-License-Identifier: Apache-2.0
"""Work that a node does after it has answered a request, so that answers are not delayed."""

import time
from collections import deque
from collections.abc import Callable

from rclpy.node import Node

from rover_planner.ros.guard import Guard
from rover_planner.ros.steady import create_steady_timer

QUIET = 0.03
"""Time after the last answer before the work begins [s]: a client has time to read the answer
and to send its next request."""
SLICE = 0.002
"""Time for which work runs before it pauses for requests [s]."""
GAP = 0.003
"""Length of this pause [s]."""
MAX_WAITING = 4
"""Largest number of answers whose work may be pending."""

Work = Callable[[], None]


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
