"""Monitors inputs: whether each is available, recent and valid."""

import math
from collections.abc import Iterable

NEVER = -math.inf
"""Time of an input that has not arrived yet [s]."""


class InputMonitor:
    """Keeps the last valid time of each input and the errors of invalid inputs."""

    def __init__(self, names: Iterable[str], timeout: float):
        """Monitor inputs by name; one older than `timeout` [s] is stale."""
        self.timeout = timeout
        self._names = tuple(names)
        self._times: dict[str, float] = {}
        self._errors: dict[str, str] = {}

    def take(self, name: str, now: float) -> None:
        """Record a valid input at time `now` [s]."""
        self._times[name] = now
        self._errors.pop(name, None)

    def refuse(self, name: str, error: str) -> None:
        """Record an invalid input; it stays a fault until a valid one arrives."""
        self._errors[name] = error

    def is_fresh(self, name: str, now: float) -> bool:
        """Return whether an input is available, valid and not stale at time `now` [s]."""
        return name not in self._errors and now - self._times.get(name, NEVER) <= self.timeout

    def find_fault(self, now: float) -> str:
        """Return the fault of the inputs at time `now` [s]; empty if there is none.

        The text of a fault does not change with time.
        """
        missing = [name for name in self._names if name not in self._times | self._errors]
        if missing:
            return f"waiting for {', '.join(missing)}"
        errors = [self._errors[name] for name in self._names if name in self._errors]
        if errors:
            return "; ".join(errors)
        stale = [name for name in self._names if not self.is_fresh(name, now)]
        if stale:
            return f"{', '.join(stale)} stale: none for {1e3 * self.timeout:.0f} ms"
        return ""
