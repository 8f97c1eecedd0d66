# SPDX-License-Identifier: Apache-2.0
"""Named values on their way to another thread, of which only the newest of each name counts."""

import threading
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Inbox(Generic[T]):
    """A queue in which a later value replaces an earlier one of the same name.

    A slider that is dragged sends dozens of values a second. Only the last one that came while the
    page was busy is worth judging; and of what a slow browser is told, only the last is worth
    sending.
    """

    def __init__(self, values: Mapping[str, T] | None = None):
        """Begin with some values."""
        self._values: dict[Any, T] = {**(values or {})}
        self._changed = threading.Condition()
        self._is_open = True

    def put(self, value: T, name: str = "") -> None:
        """Add a value, which replaces that of the same name; without a name it replaces none."""
        with self._changed:
            self._values.pop(name, None)
            self._values[name or object()] = value
            self._changed.notify()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for a value, at most for a time [s] or until it is closed; tell if there is one."""
        with self._changed:
            ready = lambda: self._values or not self._is_open  # noqa: E731
            self._changed.wait_for(ready, None if seconds is None else max(seconds, 0.0))
            return bool(self._values)

    def take(self) -> dict[Any, T]:
        """Return all values in their order, and empty it."""
        with self._changed:
            values, self._values = self._values, {}
        return values

    def close(self) -> None:
        """Wake whoever waits, for ever."""
        with self._changed:
            self._is_open, self._values = False, {}
            self._changed.notify()
