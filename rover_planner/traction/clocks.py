# SPDX-License-Identifier: Apache-2.0
"""Judges the clock of header stamps: one that was stepped or, if it is simulated, has stopped."""

from msg_adapters.stamps import NANOSECONDS

MAX_STEP = 0.1
"""Difference of the system clock from the monotonic clock that counts as a step [s]; a clock that
is only slewed gains 0.5 ms a second at most."""
MAX_SIMULATED_STEP = 1.0
"""Advance of a simulated clock between two updates that counts as a step [s]."""
USUAL_PERIOD = 0.02
"""Longest time between two checks that counts towards standing still [s]."""
STOPPED = "/clock stands still"


class ClockWatch:
    """Compares the clock of the stamps with the monotonic clock, once an update."""

    def __init__(self, timeout: float):
        """Allow a simulated clock to stand still for `timeout` [s]."""
        self.timeout = timeout
        """Time for which a simulated clock may stand still [s]."""
        self._last: tuple[float, int] | None = None
        self._advanced_at = 0.0
        self.stepped = False
        """True if the last check found a step; stamps from before it mean nothing now."""

    def check(self, now: float, clock: int, simulated: bool) -> str:
        """Return what is wrong with the clock; empty if nothing is.

        Args:
            now: Monotonic time [s].
            clock: Clock of the stamps [ns].
            simulated: Whether it follows /clock.
        """
        if self._last is None:
            self._last, self._advanced_at = (now, clock), now
        advance = (clock - self._last[1]) / NANOSECONDS
        if simulated:
            self.stepped = not 0.0 <= advance <= MAX_SIMULATED_STEP
        else:
            self.stepped = abs(advance - (now - self._last[0])) > MAX_STEP
        if advance or not simulated:
            # It may have advanced for the last time soon after the last check.
            self._advanced_at = max(self._last[0], now - USUAL_PERIOD)
        self._last = now, clock
        if self.stepped:
            return "the clock was stepped back" if advance < 0.0 else "the clock was stepped ahead"
        return STOPPED if now - self._advanced_at > self.timeout else ""
