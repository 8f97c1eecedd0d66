# SPDX-License-Identifier: Apache-2.0
"""Decides when a refusal that comes again with each message is logged again."""

import re

PERIOD = 10.0
"""Time between two log lines about refusals of one kind [s]."""
NUMBER = re.compile(r"\d+(\.\d+)?")


class RepeatLog:
    """Knows when each kind of text was logged last; texts that differ in numbers are one kind."""

    def __init__(self) -> None:
        self._told: dict[str, float] = {}
        self._left_out: dict[str, int] = {}

    def line(self, text: str, now: float) -> str:
        """Return what to log for a text at a monotonic time [s]; empty for nothing.

        The line also counts the texts of its kind that were left out since the one before.
        """
        kind = NUMBER.sub("#", text)
        if now - self._told.get(kind, -PERIOD) < PERIOD:
            self._left_out[kind] = self._left_out.get(kind, 0) + 1
            return ""
        self._told = {one: at for one, at in self._told.items() if now - at < PERIOD}
        self._told[kind] = now
        count = self._left_out.pop(kind, 0)
        return f"{text} ({count} more since the last line)" if count else text
