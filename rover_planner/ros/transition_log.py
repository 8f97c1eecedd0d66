"""Logs when a condition begins and when it ends, never each time that it is looked at."""

from rclpy.impl.rcutils_logger import RcutilsLogger

QUIET_TIME = 1.0
"""Shortest time between two lines about the same condition [s]."""


class TransitionLog:
    """Keeps what was logged last about each condition.

    A change within QUIET_TIME of the last line is logged after it, if it still holds then.
    """

    def __init__(self, logger: RcutilsLogger):
        """Log to a node's logger."""
        self._logger = logger
        self._told: dict[str, tuple[bool, float]] = {}

    def update(self, condition: str, reason: str, end: str, now: float) -> None:
        """Log a change of a condition.

        Args:
            condition: Name of the condition.
            reason: Text of the warning while the condition holds; empty if it does not.
            end: Text that says that it has ended.
            now: Monotonic time [s].
        """
        was, told_at = self._told.get(condition, (False, -QUIET_TIME))
        if bool(reason) == was or now - told_at < QUIET_TIME:
            return
        self._told[condition] = bool(reason), now
        if reason:
            self._logger.warning(reason)
        else:
            self._logger.info(end)
