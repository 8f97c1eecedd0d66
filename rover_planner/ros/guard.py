# SPDX-License-Identifier: Apache-2.0
"""Keeps a node alive: unexpected errors are counted, and those of one kind logged once."""

import contextlib
import functools
import math
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node

from msg_adapters.stamps import NANOSECONDS

EVENT_PERIOD = 1.0
"""Time between two looks at events of publishers and subscriptions, such as profiles that do not
match [s]: they are half of the entities of a wait set, and with those of a subscription that
leaves a message unread no wait lasts."""
PATIENCE, PATIENT_PERIODS = 0.1, 5
"""Time between two looks at all else where a node has a loop [s], or that number of its periods if
it is more."""


class Guard:
    """Counts the unexpected errors of a node by place; logs each kind once."""

    def __init__(self, logger: Any):
        self._logger = logger
        self._last, self._time = "", -math.inf
        self.counts: Counter[str] = Counter()
        """Number of errors by place, kind and text."""

    @property
    def total(self) -> int:
        """Number of all errors."""
        return sum(self.counts.values())

    def recent(self, seconds: float) -> str:
        """Return the place and kind of the last error if it is that recent [s], else empty."""
        return self._last if time.monotonic() - self._time <= seconds else ""

    def report(self, place: str, error: Exception) -> str:
        """Count an error, log it with its trace if it is new, and return it in one line."""
        text = f"{type(error).__name__}: {error}"[:300]
        key = f"{place}: {type(error).__name__}"
        self._last, self._time = key, time.monotonic()
        self.counts[key] += 1
        if self.counts[key] == 1:
            trace = "".join(traceback.format_exception(error))
            self._logger.error(
                f"internal error in {place}, the node goes on; logged once:\n{trace}"
            )
        return text

    def call(self, function: Callable[[], object]) -> None:
        """Call a function; report its error instead of raising it."""
        try:
            function()
        except Exception as error:
            whole = getattr(function, "func", function)  # of a partial
            self.report(getattr(whole, "__name__", "a callback"), error)


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


class GuardedExecutor(SingleThreadedExecutor):
    """An executor of one node that outlives errors in callbacks and in the reading of messages.

    They go to the node's `guard`. In rclpy, and for a node without one, such an error ends `spin`,
    and after one in the reading of a message the node's callback group stays blocked for ever.

    The timer that a node names as its `loop` is called without a wait set: to make one for each
    wait, as rclpy does, takes longer than most updates. All else is looked at from time to time.
    """

    def __init__(self, **executor_arguments: Any):
        super().__init__(**executor_arguments)
        self._guard_of_node: Guard | None = None
        self._events_due, self._looks_at_events = 0.0, False
        self._loop: Any = None
        self._loop_due = self._others_due = 0.0

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Call what is ready next; a loop that is due comes first."""
        now, has_loop = time.monotonic(), self._is_apart(self._loop)
        if has_loop and not self._others_due <= now < self._loop_due:
            self._call_loop()
        elif has_loop or now >= self._events_due:
            self._call_other(now)
        else:
            super().spin_once(timeout_sec)

    def _is_apart(self, timer: Any) -> bool:
        """Return whether a timer is a loop; with a simulated clock, /clock comes before loops."""
        if timer is None or timer is not self._loop or timer.is_canceled():
            return False
        return not self._ros_clock.ros_time_is_active

    def _call_loop(self) -> None:
        now = time.monotonic()
        time.sleep(max(self._loop_due - now, 0.0))
        self._loop_due = max(self._loop_due, now) + self._loop.timer_period_ns / NANOSECONDS
        try:
            self._loop.callback()
        except Exception as error:
            self._report("the loop", error)

    def _call_other(self, now: float) -> None:
        """Call one of what is ready besides a loop; look again later if there is nothing."""
        self._looks_at_events = now >= self._events_due
        try:
            call, _, _ = self.wait_for_ready_callbacks(timeout_sec=0.0)
        except TimeoutException:
            self._others_due = time.monotonic() + self._find_patience()
            if self._looks_at_events:
                self._events_due = now + EVENT_PERIOD
        else:
            call()
            call.result()  # raises the error of a node without a guard
        finally:
            self._looks_at_events = False

    def _find_patience(self) -> float:
        period = 0.0 if self._loop is None else self._loop.timer_period_ns / NANOSECONDS
        return max(PATIENCE, PATIENT_PERIODS * period)

    def can_execute(self, entity: Any) -> bool:
        """Return whether the next wait is for an entity, too; events wait for their turn."""
        if isinstance(entity, EventHandler) and not self._looks_at_events:
            return False
        return not self._is_apart(entity) and bool(super().can_execute(entity))

    def add_node(self, node: Node) -> bool:
        """Add the node; errors of its callbacks go to its guard, if it has one."""
        self._guard_of_node = getattr(node, "guard", None)
        self._loop, self._ros_clock = getattr(node, "loop", None), node.get_clock()
        return bool(super().add_node(node))

    def _make_handler(self, entity, node, take_from_wait_list):
        """Return a handler of an entity's work, as rclpy does, that raises no error."""

        def take(ready):
            try:
                work = take_from_wait_list(ready)
            except Exception as error:
                self._report(f"reading of {_name(ready)}", error)
                return None
            return None if work is None else functools.partial(self._run, ready, work)

        return super()._make_handler(entity, node, take)

    async def _run(self, entity, work) -> None:
        try:
            await work()
        except Exception as error:
            self._report(_name(entity), error)

    def _report(self, place: str, error: Exception) -> None:
        if not self.context.ok():
            return  # whoever reads or publishes while ROS shuts down fails
        if self._guard_of_node is None:
            raise error
        self._guard_of_node.report(place, error)


def _name(entity: Any) -> str:
    """Return the name of the topic or service of an entity, else its kind."""
    for name in ("topic_name", "service_name"):
        if hasattr(entity, name):
            return str(getattr(entity, name))
    return type(entity).__name__
