# SPDX-License-Identifier: Apache-2.0
"""Judges header stamps and the clock that they come from.

Frozen, delayed and future stamps must not pass as recent measurements. Neither may a clock that
was stepped or, if it is simulated, has stopped.
"""

from rover_planner.errors import PlanningError

NANOSECONDS = 1_000_000_000
MAX_STEP = 0.1
"""Difference of the system clock from the monotonic clock that counts as a step [s]; a clock that
is only slewed gains 0.5 ms a second at most."""
MAX_SIMULATED_STEP = 1.0
"""Advance of a simulated clock between two updates that counts as a step [s]."""
USUAL_PERIOD = 0.02
"""Longest time between two checks that counts towards standing still [s]."""
STOPPED = "/clock stands still"


class StampError(PlanningError):
    """A message that is not used because of its stamp; the text says why."""


class StampCheck:
    """Keeps the last stamp of each stream and converts stamps into times of measurement."""

    def __init__(self, tolerance: float):
        """Refuse stamps that are further ahead of the clock than `tolerance` [s]."""
        self.tolerance = tolerance
        """Time that a stamp may be ahead of the clock [s]."""
        self._last: dict[str, int] = {}

    def forget(self) -> None:
        """Forget all stamps, after the clock was stepped."""
        self._last.clear()

    def find_time(
        self, name: str, stamp: int, clock: int, now: float, *, merged: bool = False
    ) -> float:
        """Return the time of a measurement on the monotonic clock [s].

        It is the time of arrival less the age by the header stamp. A message without a stamp (0)
        has the time of its arrival.

        Args:
            name: The stream.
            stamp: Its header stamp [ns].
            clock: The clock of the stamps [ns].
            now: Time of arrival, monotonic [s].
            merged: Whether several publishers share the stream; their stamps need not ascend.

        Raises:
            StampError: The stamp does not advance, or is ahead of the clock.
        """
        if stamp == 0:
            return now
        age = (clock - stamp) / NANOSECONDS
        if age < -self.tolerance:
            raise StampError(
                f"stamps are more than {1e3 * self.tolerance:.0f} ms ahead of this node's clock; "
                "synchronise the clocks"
            )
        if not merged:
            if stamp <= self._last.get(name, 0):
                raise StampError("stamps do not advance")
            self._last[name] = stamp
        return now - max(age, 0.0)


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
