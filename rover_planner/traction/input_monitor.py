# SPDX-License-Identifier: Apache-2.0
"""Monitors inputs: whether each is available, recent and valid."""

import math
from collections.abc import Mapping

NEVER = -math.inf
"""Time of an input that has not arrived yet [s]."""


class InputMonitor:
    """Keeps the last valid time of each input and the errors of invalid inputs."""

    def __init__(self, timeouts: Mapping[str, float]):
        """Monitor inputs by name; one older than its timeout [s] is stale."""
        self.timeouts = dict(timeouts)
        """Timeouts [s] by name."""
        self._times: dict[str, float] = {}
        self._errors: dict[str, tuple[str, float]] = {}
        self._ignored: dict[str, str] = {}
        self._details: dict[str, str] = {}

    def take(self, name: str, time: float) -> None:
        """Record a valid input that was measured at a time [s]."""
        self._times[name] = max(time, self._times.get(name, NEVER))
        self._ignored.pop(name, None)
        self._details.pop(name, None)
        if name in self._errors and time >= self._errors[name][1]:
            del self._errors[name]

    def refuse(self, name: str, error: str, now: float = NEVER) -> None:
        """Record an invalid input; it is a fault until one that was measured later arrives."""
        self._errors[name] = error, now

    def ignore(self, name: str, reason: str) -> None:
        """Record why a message was not used; the reason is shown when the input is stale."""
        self._ignored[name] = reason

    def describe(self, name: str, detail: str) -> None:
        """Take what is known about a stale input, such as which part of it is missing."""
        self._details[name] = detail

    def forget(self) -> None:
        """Forget the times of all inputs: each must arrive anew."""
        self._times.clear()

    def is_fresh(self, name: str, now: float) -> bool:
        """Return whether an input is available, valid and not stale at time `now` [s]."""
        age = now - self._times.get(name, NEVER)
        return name not in self._errors and age <= self.timeouts[name]

    @property
    def expiry(self) -> float:
        """Time at which the first of the inputs becomes stale [s]."""
        return min(
            self._times.get(name, NEVER) + timeout for name, timeout in self.timeouts.items()
        )

    def find_fault(self, now: float) -> str:
        """Return the fault of the inputs at time `now` [s]; empty if there is none.

        The text of a fault does not change with time.
        """
        missing = [name for name in self.timeouts if name not in self._times | self._errors]
        if missing:
            reasons = "".join(self._describe_ignored(name) for name in missing)
            return f"waiting for {', '.join(missing)}{reasons}"
        errors = [self._errors[name][0] for name in self.timeouts if name in self._errors]
        if errors:
            return "; ".join(errors)
        stale = [name for name in self.timeouts if not self.is_fresh(name, now)]
        return "; ".join(
            f"{name} stale: none for {1e3 * self.timeouts[name]:.0f} ms"
            f"{self._describe_ignored(name)}"
            for name in stale
        )

    def _describe_ignored(self, name: str) -> str:
        known = (self._details.get(name, ""), self._ignored.get(name, ""))
        text = "; ".join(filter(None, known))
        return f" ({text})" if text else ""
