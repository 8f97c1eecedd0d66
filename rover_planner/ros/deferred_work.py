"""What a node does after it has answered a request, so that nobody waits for it."""

import time
import traceback
from collections import deque
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

QUIET = 0.03
"""Time without an answer after which the work begins [s]: whoever asked reads the answer first,
and asks again."""
SLICE = 0.002
"""Work that takes longer than this in one go waits for requests before it goes on [s]..."""
GAP = 0.003
"""... for so long [s]."""
MAX_WAITING = 4
"""Answers whose work may wait for further requests to be answered."""

Work = Callable[[], None]


class DeferredWork:
    """Runs work that was put off: answer by answer, piece by piece, and requests go first.

    A timer runs the pieces, and every further answer sets it back. So a request that comes
    meanwhile waits for no more than one SLICE and the piece that exceeds it. Under requests
    without a pause the work of MAX_WAITING answers waits at most; then that of the oldest is
    done, all of it, before the next request is looked at. Nothing is left out, nothing overtakes.
    """

    def __init__(self, node: Node):
        self._node = node
        self._answers: deque[deque[Work]] = deque()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(QUIET, self._run_some, clock=steady, autostart=False)
        self._too_many = node.create_guard_condition(self._run_oldest)

    def do(self, *pieces: Work) -> None:
        """Put off the work of one answer; where a piece of it fails the log says so."""
        self._answers.append(deque(pieces))
        self._wait(QUIET)
        if len(self._answers) > MAX_WAITING:
            self._too_many.trigger()

    def _run_some(self) -> None:
        """Run pieces for about a SLICE."""
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
        """Run what belongs to the oldest answers until no more than MAX_WAITING are left."""
        while len(self._answers) > MAX_WAITING:
            self._run_next()

    def _run_next(self) -> None:
        """Run the next piece of the oldest answer."""
        pieces = self._answers[0]
        try:
            if pieces:
                pieces.popleft()()
        except Exception:
            # A fault of this program must not leave the rover without a planner.
            self._node.get_logger().error(traceback.format_exc())
        if not pieces:
            self._answers.popleft()
