# SPDX-License-Identifier: Apache-2.0
"""Decides what is worth a line in the log: changes that last, and refusals that come again."""

import math
import re
from dataclasses import dataclass

from rclpy.impl.rcutils_logger import RcutilsLogger

QUIET_TIME = 1.0
"""Shortest time between two lines about the same condition [s]."""
REPEAT_PERIOD = 10.0
"""Time between two log lines about refusals of one kind [s]."""
NUMBER = re.compile(r"\d+(\.\d+)?")


@dataclass
class _Condition:
    """State of a condition."""

    holds: bool = False
    """True if it held at the last look."""
    changed: bool = False
    """True if it has changed since the last line."""
    logged_at: float = -math.inf
    """Time of the last line [s]."""
    logged: bool = False
    """True if the last line said that it held."""
    passed: str = ""
    """The reason why it held last."""


class TransitionLog:
    """Logs changes of conditions; those within QUIET_TIME of a line share one line after it."""

    def __init__(self, logger: RcutilsLogger):
        """Log to a node's logger."""
        self._logger = logger
        self._conditions: dict[str, _Condition] = {}

    def update(self, name: str, reason: str, end: str, now: float) -> None:
        """Log a change of a condition.

        Args:
            name: Name of the condition.
            reason: Text of the warning while the condition holds; empty if it does not.
            end: Text that says that it has ended.
            now: Monotonic time [s].
        """
        condition = self._conditions.setdefault(name, _Condition())
        condition.passed = reason or condition.passed
        if bool(reason) != condition.holds:
            condition.holds, condition.changed = bool(reason), True
        if not condition.changed or now - condition.logged_at < QUIET_TIME:
            return
        condition.changed, condition.logged_at = False, now
        was_logged, condition.logged = condition.logged, bool(reason)
        if reason:
            self._logger.warning(reason)
        elif was_logged:
            self._logger.info(end)
        else:
            self._logger.info(f"{end}; it was for less than {QUIET_TIME:g} s: {condition.passed}")


class RepeatLog:
    """Knows when each kind of text was logged last; texts that differ in numbers are one kind."""

    def __init__(self) -> None:
        self._logged: dict[str, float] = {}
        self._left_out: dict[str, int] = {}

    def line(self, text: str, now: float) -> str:
        """Return what to log for a text at a monotonic time [s]; empty for nothing.

        The line also counts the texts of its kind that were left out since the one before.
        """
        kind = NUMBER.sub("#", text)
        if now - self._logged.get(kind, -REPEAT_PERIOD) < REPEAT_PERIOD:
            self._left_out[kind] = self._left_out.get(kind, 0) + 1
            return ""
        self._logged = {one: at for one, at in self._logged.items() if now - at < REPEAT_PERIOD}
        self._logged[kind] = now
        count = self._left_out.pop(kind, 0)
        return f"{text} ({count} more since the last line)" if count else text
