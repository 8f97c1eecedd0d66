"""Monitors inputs: which of them are there, fresh and usable."""

import math
from collections.abc import Iterable

NEVER = -math.inf
"""Time of an input that has not come yet [s]."""


class InputMonitor:
    """When each input was last good, and what is wrong with those that came bad."""

    def __init__(self, names: Iterable[str], timeout: float):
        """Monitor inputs by name; one older than `timeout` [s] is stale."""
        self.timeout = timeout
        self._names = tuple(names)
        self._times: dict[str, float] = {}
        self._errors: dict[str, str] = {}

    def take(self, name: str, now: float) -> None:
        """Note that a good input came at a time [s]."""
        self._times[name] = now
        self._errors.pop(name, None)

    def refuse(self, name: str, error: str) -> None:
        """Note that an unusable input came; the input is at fault until a good one comes."""
        self._errors[name] = error

    def is_fresh(self, name: str, now: float) -> bool:
        """Tell whether an input is there, good and not stale."""
        return name not in self._errors and now - self._times.get(name, NEVER) <= self.timeout

    def find_fault(self, now: float) -> str:
        """Return what is wrong with the inputs, empty where nothing is.

        The same fault has the same text: it holds no times.
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
