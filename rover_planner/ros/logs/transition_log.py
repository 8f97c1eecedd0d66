# SPDX-License-Identifier: Apache-2.0
"""Logs when a condition begins and when it ends, never each time that it is looked at."""

import math
from dataclasses import dataclass

from rclpy.impl.rcutils_logger import RcutilsLogger

QUIET_TIME = 1.0
"""Shortest time between two lines about the same condition [s]."""


@dataclass
class _Condition:
    """What is known about a condition."""

    holds: bool = False
    """Whether it held when it was looked at last."""
    changed: bool = False
    """Whether it has changed since the last line."""
    told_at: float = -math.inf
    """Time of the last line [s]."""
    told: bool = False
    """What the last line said: whether it held."""
    passed: str = ""
    """The reason why it held last."""


class TransitionLog:
    """Logs changes of conditions; those within QUIET_TIME of a line are told by one line after."""

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
        if not condition.changed or now - condition.told_at < QUIET_TIME:
            return
        condition.changed, condition.told_at = False, now
        was_told, condition.told = condition.told, bool(reason)
        if reason:
            self._logger.warning(reason)
        elif was_told:
            self._logger.info(end)
        else:
            self._logger.info(f"{end}; it was for less than {QUIET_TIME:g} s: {condition.passed}")
