# SPDX-License-Identifier: Apache-2.0
"""Ages, faults and stamps of the inputs of traction control, and the clock of the stamps.

Frozen, delayed and future stamps must not pass as recent measurements.
"""

import math
from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from msg_adapters.stamps import NANOSECONDS
from rover_planner.errors import PlanningError

NEVER = -math.inf
"""Time of an input that has not arrived yet [s]."""


class StampError(PlanningError):
    """A message that is not used because of its stamp; the text says why."""


@dataclass
class InputRecord:
    """Last valid time [s] of one input, its last stamp [ns], and what is wrong with it."""

    time: float = NEVER
    stamp: int = 0
    error: str = ""
    error_time: float = NEVER
    ignored: str = ""

    def describe(self, detail: str) -> str:
        """Return why nothing recent was used, in brackets; empty if that is not known."""
        text = "; ".join(filter(None, (detail, self.ignored)))
        return f" ({text})" if text else ""


class InputMonitor:
    """Keeps the last valid time of each input and the errors of invalid inputs."""

    def __init__(self, timeouts: Mapping[str, float], optional: Collection[str] = ()):
        """Monitor inputs by name; one older than its timeout [s] is stale.

        Inputs that are `optional` are never a fault; those with an infinite timeout are one only
        where they are refused.
        """
        self.timeouts = dict(timeouts)
        """Timeouts [s] by name."""
        self.tolerance = 0.0
        """Time that a stamp may be ahead of the clock [s]."""
        self._optional = optional
        self._inputs: defaultdict[str, InputRecord] = defaultdict(InputRecord)

    def find_time(
        self, name: str, stamp: int, clock: int, now: float, *, merged: bool = False
    ) -> float:
        """Return the time of a measurement on the monotonic clock [s].

        It is the time of arrival less the age by the header stamp. A message without a stamp (0)
        has the time of its arrival.

        Args:
            name: The input.
            stamp: Its header stamp [ns].
            clock: The clock of the stamps [ns].
            now: Time of arrival, monotonic [s].
            merged: Whether several publishers share the topic; their stamps need not ascend.

        Raises:
            StampError: The stamp does not advance, or is ahead of the clock.
        """
        if stamp == 0:
            return now
        age, record = (clock - stamp) / NANOSECONDS, self._inputs[name]
        if age < -self.tolerance:
            raise StampError(
                f"stamps are more than {1e3 * self.tolerance:.0f} ms ahead of this node's clock; "
                "synchronise the clocks"
            )
        if not merged:
            if stamp <= record.stamp:
                raise StampError("stamps do not advance")
            record.stamp = stamp
        return now - max(age, 0.0)

    def take(self, name: str, time: float) -> None:
        """Record a valid input that was measured at a time [s]."""
        record = self._inputs[name]
        record.time = max(time, record.time)
        record.ignored = ""
        if time >= record.error_time:
            record.error = ""

    def refuse(self, name: str, error: str, now: float = NEVER) -> None:
        """Record an invalid input; it is a fault until one that was measured later arrives."""
        record = self._inputs[name]
        record.error, record.error_time = error, now

    def ignore(self, name: str, reason: str) -> None:
        """Record why a message was not used; the reason is shown when the input is stale."""
        self._inputs[name].ignored = reason

    def forget(self) -> None:
        """Forget times and stamps of all inputs: each must arrive anew."""
        for record in self._inputs.values():
            record.time, record.stamp = NEVER, 0

    def is_fresh(self, name: str, now: float) -> bool:
        """Return whether an input is available, valid and not stale at time `now` [s]."""
        record = self._inputs[name]
        return not record.error and now - record.time <= self.timeouts[name]

    @property
    def expiry(self) -> float:
        """Time at which the first of the needed inputs becomes stale [s]."""
        needed = self._find_needed()
        return min(record.time + self.timeouts[name] for name, record in needed.items())

    def find_fault(self, now: float, details: Mapping[str, str] | None = None) -> str:
        """Return the fault of the needed inputs at time `now` [s]; empty if there is none.

        The text of a fault does not change with time. `details` tell what is known about a stale
        input, by name, such as which part of it is missing.
        """
        details = details or {}
        needed = self._find_needed()
        missing = {n: one for n, one in needed.items() if one.time == NEVER and not one.error}
        if missing:
            reasons = "".join(one.describe(details.get(n, "")) for n, one in missing.items())
            return f"waiting for {', '.join(missing)}{reasons}"
        errors = [record.error for record in needed.values() if record.error]
        return "; ".join(
            errors
            or [
                f"{name} stale: none for {1e3 * self.timeouts[name]:.0f} ms"
                f"{record.describe(details.get(name, ''))}"
                for name, record in needed.items()
                if not self.is_fresh(name, now)
            ]
        )

    def _find_needed(self) -> dict[str, InputRecord]:
        needed = {n: self._inputs[n] for n in self.timeouts if n not in self._optional}
        return {n: one for n, one in needed.items() if one.error or self.timeouts[n] < math.inf}


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
