# SPDX-License-Identifier: Apache-2.0
"""The time that a question may take, and the request to stop it."""

import time
from collections.abc import Callable

BUSY, TOO_LONG, CANCELLED, STOPPING = "busy", "too_long", "cancelled", "stopping"
"""Codes of questions that were not answered in time, or stopped."""


class QuestionStoppedError(Exception):
    """A question was stopped before its answer was found; no fault of its input."""

    def __init__(self, code: str, reason: str):
        """Keep the code, such as TOO_LONG, and the reason in words."""
        super().__init__(reason)
        self.code = code


class Budget:
    """Deadline of one question; it may be cancelled from another thread."""

    def __init__(self, seconds: float, clock: Callable[[], float] = time.monotonic):
        """Start the time.

        Args:
            seconds: Time until the deadline [s].
            clock: Returns the time [s].
        """
        self.seconds = seconds
        """Time from the start to the deadline [s]."""
        self._clock = clock
        self._deadline = clock() + seconds
        self._stopped: QuestionStoppedError | None = None

    @property
    def remaining(self) -> float:
        """Time until the deadline [s], negative after it."""
        return self._deadline - self._clock()

    @property
    def stopped(self) -> QuestionStoppedError | None:
        """Why the question is over: it was stopped, or took too long; None while it is not."""
        if self._stopped is None and self.remaining <= 0.0:
            self.stop(
                TOO_LONG,
                f"no answer was found within the time budget of {self.seconds:g} s; ask for a "
                "shorter path, fewer candidates or wider waypoints, or raise time_budget",
            )
        return self._stopped

    def stop(self, code: str, reason: str) -> None:
        """Make every later `check` raise with this code and reason; the first stop counts."""
        self._stopped = self._stopped or QuestionStoppedError(code, reason)

    def check(self) -> None:
        """Return if the work may go on.

        Raises:
            QuestionStoppedError: The deadline has passed, or the question was stopped.
        """
        if self.stopped is not None:
            raise self.stopped
