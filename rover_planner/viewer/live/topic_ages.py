# SPDX-License-Identifier: Apache-2.0
"""How old the last message of each topic is, and which topics are stale."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

MAX_AGE = 2.0
"""Age from which a topic that is published all the time is stale [s]."""


@dataclass(frozen=True)
class TopicAge:
    """The age of a topic's last message."""

    topic: str
    """Its name."""
    age: float | None
    """[s]; None if none has come."""
    is_stream: bool
    """Whether it is published all the time; others come when there is something new."""

    @property
    def is_stale(self) -> bool:
        """Whether its values are no longer those of the rover."""
        return self.is_stream and self.age is not None and self.age > MAX_AGE

    def describe(self) -> str:
        """Return the age in words."""
        if self.age is None:
            return "nothing yet"
        return f"{self.age:.1f} s" if self.age < 10.0 else f"{self.age:.0f} s"


class TopicAges:
    """Notes when topics were heard; its methods may be called from any thread."""

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """Know no topic yet; `now` returns the time [s]."""
        self._now = now
        self._lock = threading.Lock()
        self._heard: dict[str, float | None] = {}
        self._streams: set[str] = set()

    def expect(self, topic: str, *, is_stream: bool) -> None:
        """List a topic."""
        with self._lock:
            self._heard.setdefault(topic, None)
            if is_stream:
                self._streams.add(topic)

    def hear(self, topic: str) -> None:
        """Note that a topic's message has come now."""
        with self._lock:
            self._heard[topic] = self._now()

    def is_stale(self, topic: str) -> bool:
        """Return whether a topic was heard, but not lately."""
        return any(one.is_stale for one in self.list_all() if one.topic == topic)

    def list_all(self) -> Sequence[TopicAge]:
        """Return the ages of all topics in the order in which they were listed."""
        now = self._now()
        with self._lock:
            return tuple(
                TopicAge(topic, None if heard is None else now - heard, topic in self._streams)
                for topic, heard in self._heard.items()
            )
