# SPDX-License-Identifier: Apache-2.0
"""Counts and faults of a traverse server, for its diagnostics."""

from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

MEMORY = 10.0
"""Time for which a refused question or an internal error counts as a present fault [s]."""
OK, WARN, ERROR = "ok", "warning", "error"
"""Levels of the health."""
LATENCIES = 100
"""Number of the last answers whose times are kept."""
OVERLOADS = ("busy", "too_long")
"""Codes of questions for which there was no time."""


@dataclass(frozen=True)
class Health:
    """The state of a server at one time."""

    level: str
    """OK, WARN or ERROR."""
    message: str
    """The faults in words; "ready" without any."""
    values: dict[str, Any]
    """Counts by name."""


class ServerHealth:
    """Counts questions and faults of a server."""

    def __init__(self) -> None:
        self._codes: Counter[str] = Counter()
        self._overload, self._overload_time = "", -float("inf")
        self._map_refusal = ""
        self._last: dict[str, Any] = {"last question": "none"}
        self._last_time = 0.0
        self._latencies: deque[float] = deque(maxlen=LATENCIES)

    def take_answer(self, code: str, now: float, question: str, latency: float) -> None:
        """Count an answer.

        Args:
            code: Code of its reason, empty if the path is traversable.
            now: Time of the steady clock [s].
            question: Number and service of the question.
            latency: Time from the arrival of the question to its answer [s].
        """
        self._codes[code or "traversable"] += 1
        self._last = {"last question": question, "last answer": code or "traversable"}
        self._last_time = now
        self._latencies.append(latency)
        if code in OVERLOADS:
            self._overload, self._overload_time = code, now

    def take_map(self, refusal: str = "") -> None:
        """Note a map that was taken, or the reason why it was refused."""
        self._map_refusal = refusal

    def describe(self, now: float, map_fault: str, error: str, counts: dict[str, Any]) -> Health:
        """Return the health at time `now` [s].

        Args:
            now: Time of the steady clock [s].
            map_fault: Why there is no map to plan on; empty if there is one.
            error: The last internal error if it is recent, else empty.
            counts: Further values to show.
        """
        values = {
            **counts,
            **self._describe_last(now),
            **{f"answers {code}": n for code, n in sorted(self._codes.items())},
        }
        if error:
            return Health(ERROR, f"internal error in {error}", values)
        overload = now - self._overload_time <= MEMORY
        faults = [
            map_fault,
            f"last map refused: {self._map_refusal}" if self._map_refusal else "",
            f"questions refused: {self._overload}" if overload else "",
        ]
        text = "; ".join(fault for fault in faults if fault)
        return Health(WARN if text else OK, text or "ready", values)

    def _describe_last(self, now: float) -> dict[str, Any]:
        """Return the last question, its age and times of the last LATENCIES answers."""
        if not self._latencies:
            return self._last
        return {
            **self._last,
            "last answer age [s]": f"{now - self._last_time:.1f}",
            "last latency [ms]": f"{1e3 * self._latencies[-1]:.1f}",
            f"largest latency of {len(self._latencies)} [ms]": f"{1e3 * max(self._latencies):.1f}",
        }
