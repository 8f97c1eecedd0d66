# SPDX-License-Identifier: Apache-2.0
"""Judges header stamps: frozen, delayed and future ones must not pass as recent measurements."""

from rover_planner.errors import PlanningError

NANOSECONDS = 1_000_000_000


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
