# SPDX-License-Identifier: Apache-2.0
"""Decides what is worth a line in the log: changes that last, and refusals that come again."""

import math
import re

from rclpy.impl.rcutils_logger import RcutilsLogger

QUIET_TIME = 1.0
"""Shortest time between two lines about the same condition [s]."""
REPEAT_PERIOD = 10.0
"""Time between two log lines about refusals of one kind [s]."""
NUMBER = re.compile(r"\d+(\.\d+)?")


class TransitionLog:
    """Logs changes of conditions; those within QUIET_TIME of a line share one line after it."""

    def __init__(self, logger: RcutilsLogger):
        """Log to a node's logger."""
        self._logger = logger
        self._logged: dict[str, float] = {}  # time of the last line about each condition [s]
        self._reasons: dict[str, list[str]] = {}  # of that line, and of each change since

    def update(self, name: str, reason: str, end: str, now: float) -> None:
        """Log a change of a condition.

        Args:
            name: Name of the condition.
            reason: Text of the warning while the condition holds; empty if it does not.
            end: Text that says that it has ended.
            now: Monotonic time [s].
        """
        reasons = self._reasons.setdefault(name, [""])
        if bool(reason) != bool(reasons[-1]):
            reasons.append(reason)
        reasons[-1] = reason
        if len(reasons) == 1 or now - self._logged.get(name, -math.inf) < QUIET_TIME:
            return
        self._logged[name], self._reasons[name] = now, [reason]
        if reason:
            self._logger.warning(reason)
        elif reasons[0]:
            self._logger.info(end)
        else:
            self._logger.info(f"{end}; it was for less than {QUIET_TIME:g} s: {reasons[-2]}")


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
