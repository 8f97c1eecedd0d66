"""Keeps a fault until its cause has been gone for a while, so that it does not flap."""

import math

RECOVERY_TIME = 0.2
"""Time for which everything must be right before the rover drives again [s]."""


class FaultLatch:
    """A fault counts at once and passes RECOVERY_TIME after its cause."""

    def __init__(self) -> None:
        """Start without a fault."""
        self._fault, self._end = "", -math.inf

    def update(self, fault: str, now: float) -> str:
        """Return the fault that counts at time `now` [s]; empty if there is none.

        Args:
            fault: What is wrong now; empty if nothing is.
            now: Monotonic time [s].
        """
        if fault:
            self._fault, self._end = fault, now + RECOVERY_TIME
        elif now >= self._end:
            self._fault = ""
        return self._fault
