# SPDX-License-Identifier: Apache-2.0
"""Requests of visitors, queued for the one thread that changes the page."""

import threading
from collections.abc import Callable

Action = Callable[[], None]


class VisitorRequests:
    """A queue in which a later request replaces an earlier one of the same kind.

    A slider that is dragged sends dozens of values a second. Only the last one that came while the
    page was busy is worth judging.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pending: list[tuple[str, Action]] = []
        self._available = threading.Event()

    def add(self, action: Action, kind: str = "") -> None:
        """Add a request; it replaces those of the same kind, if `kind` is not empty."""
        with self._lock:
            if kind:
                self._pending = [request for request in self._pending if request[0] != kind]
            self._pending.append((kind, action))
        self._available.set()

    def wait(self, seconds: float) -> None:
        """Wait until there is a request, at most for a time [s]."""
        self._available.wait(max(seconds, 0.0))

    def take_all(self) -> list[Action]:
        """Return all requests in their order, and empty the queue."""
        with self._lock:
            pending, self._pending = self._pending, []
            self._available.clear()
        return [action for _, action in pending]
