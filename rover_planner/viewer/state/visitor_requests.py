"""What visitors ask for, kept until the one thread that changes the page gets to it."""

import threading
from collections.abc import Callable

Act = Callable[[], None]


class VisitorRequests:
    """A queue in which a later wish of the same kind replaces an earlier one.

    While a slider is dragged the page is told dozens of values a second; only the last one that
    came while it was busy is worth judging.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: list[tuple[str, Act]] = []
        self._some = threading.Event()

    def ask(self, act: Act, kind: str = "") -> None:
        """Ask for an act; it takes the place of one of the same kind, unless that is empty."""
        with self._lock:
            if kind:
                self._asked = [wish for wish in self._asked if wish[0] != kind]
            self._asked.append((kind, act))
        self._some.set()

    def wait(self, seconds: float) -> None:
        """Wait until there is a wish, at most for a time [s]."""
        self._some.wait(max(seconds, 0.0))

    def take(self) -> list[Act]:
        """Return what is asked for, in that order, and forget it."""
        with self._lock:
            asked, self._asked = self._asked, []
            self._some.clear()
        return [act for _, act in asked]
