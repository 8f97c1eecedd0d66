# SPDX-License-Identifier: Apache-2.0
"""Between threads: a worker that takes the newest steps, and the newest values by name."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from rover_physics.numerics.interruption import interruptible

PATIENCE = 0.2
"""Time for which work may go on to its first result although a newer request waits [s]: a slider
that is dragged still gets results where they take less."""
END_TIME = 20.0
"""Longest wait for the thread when the work is closed [s]."""

Result = TypeVar("Result")
Value = TypeVar("Value")


@dataclass(frozen=True)
class WorkStep:
    """A step of the work that has begun."""

    what: str = ""
    """Name of what is worked on; empty before the first."""
    step: int = 0
    """Its number, from 1."""
    steps: int = 0
    """Number of all."""
    seconds: float = 0.0
    """Time since the work was asked for, or since its last result [s]."""

    def describe(self) -> str:
        """Return the progress in words, such as "judging path 2 of 5"."""
        many = f" {self.step} of {self.steps}" if self.steps > 1 else ""
        return f"{self.what or 'waiting'}{many}"


Steps = Iterator[WorkStep | Result]
"""Yields what is begun, and all results, each as soon as it is known."""
Take = Callable[[Steps[Result], Result | BaseException], object]
"""Takes a result of steps, or the error that ended them."""


class _StoppedError(Exception):
    """Leaves work that was cancelled or replaced."""


class BackgroundWork(Generic[Result]):
    """Takes the newest steps that were asked for; those that newer ones replace are dropped.

    Newer steps stop those that have had PATIENCE, or have given their first result. All have
    threads of their own: the newer ones do not wait for the last step of those that have given
    their result, which on rough ground takes longer than a result. The methods may be called from
    any thread.
    """

    def __init__(self, take: Take[Result], name: str = "background"):
        """Do nothing yet.

        Args:
            take: Called in the thread with all that is found, in the order in which it was asked
                for. It may wait until that was used.
            name: Name of the threads.
        """
        self._take, self._name = take, name
        self._lock = threading.RLock()
        # The lock guards all that follows.
        self._waiting: Steps[Result] | None = None
        self._in_work: Steps[Result] | None = None
        self._has_result = False
        self._progress = WorkStep()
        self._since = 0.0
        self._threads: list[threading.Thread] = []
        """The last one is that of the steps in work; those before it end their last steps."""

    def ask(self, steps: Steps[Result]) -> None:
        """Take steps instead of those that wait, and soon instead of those in work.

        Between the slices of the model's sweeps they may be stopped by an error, which they must
        let pass.
        """
        with self._lock:
            if self._in_work is None or self._has_result:
                self._progress, self._since = WorkStep(), time.monotonic()
                self._begin(steps)
            else:
                self._waiting = steps

    def cancel(self) -> bool:
        """Stop all work; what it finds after this is dropped. Return whether there was any."""
        with self._lock:
            was_busy = self._in_work is not None
            self._waiting = self._in_work = None
        return was_busy

    @property
    def progress(self) -> WorkStep | None:
        """Step of the work; None if there is none."""
        with self._lock:
            if self._in_work is None:
                return None
            return replace(self._progress, seconds=time.monotonic() - self._since)

    def close(self) -> bool:
        """Stop all work; return whether its threads end, each within END_TIME."""
        self.cancel()
        for thread in self._threads:
            thread.join(END_TIME)
        return not any(thread.is_alive() for thread in self._threads)

    def _begin(self, steps: Steps[Result]) -> None:
        self._in_work, self._waiting, self._has_result = steps, None, False
        earlier = [one for one in self._threads if one.is_alive()]
        arguments = steps, earlier
        thread = threading.Thread(target=self._do, args=arguments, name=self._name, daemon=True)
        self._threads = [*earlier, thread]
        thread.start()

    def _do(self, steps: Steps[Result], earlier: Sequence[threading.Thread]) -> None:
        """Take steps; what follows a first result waits for the end of earlier threads."""
        begun = time.monotonic()

        def check() -> None:
            gives_way = self._has_result or time.monotonic() - begun >= PATIENCE
            if self._in_work is not steps or (self._waiting is not None and gives_way):
                raise _StoppedError("newer work or a visitor stopped the work")

        try:
            with interruptible(check):
                for found in steps:
                    if isinstance(found, WorkStep):
                        check()
                        with self._lock:
                            self._progress = found
                    else:
                        self._deliver(steps, found)
                        for thread in earlier:
                            thread.join()
                        check()
        except _StoppedError:
            pass
        except BaseException as error:  # other work must go on; who takes it tells of it
            if self._waiting is None:
                self._deliver(steps, error)
        with self._lock:
            if self._in_work is steps:
                self._in_work = None
                if self._waiting is not None:
                    self._begin(self._waiting)

    def _deliver(self, steps: Steps[Result], found: Result | BaseException) -> None:
        """Hand over what was found, unless it was cancelled or replaced."""
        with self._lock:
            if self._in_work is not steps:
                return
            self._since, self._has_result = time.monotonic(), True
        self._take(steps, found)


class Inbox(Generic[Value]):
    """A queue in which a later value replaces an earlier one of the same name.

    A slider that is dragged sends dozens of values a second. Only the last one that came while the
    page was busy is worth judging; and of what a slow browser is told, only the last is worth
    sending.
    """

    def __init__(self, values: Mapping[str, Value] | None = None):
        """Begin with some values."""
        self._values: dict[Any, Value] = {**(values or {})}
        self._changed = threading.Condition()
        self._is_open = True

    def put(self, value: Value, name: str = "") -> None:
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

    def take(self) -> dict[Any, Value]:
        """Return all values in their order, and empty it."""
        with self._changed:
            values, self._values = self._values, {}
        return values

    def close(self) -> None:
        """Wake whoever waits, for ever."""
        with self._changed:
            self._is_open, self._values = False, {}
            self._changed.notify()
