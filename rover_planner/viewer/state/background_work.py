# SPDX-License-Identifier: Apache-2.0
"""One worker thread that does the newest request: progress, cancel, and results as values."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from rover_physics.numerics.interruption import interruptible

PATIENCE = 0.2
"""Time for which work may go on to its first result although a newer request waits [s]: a slider
that is dragged still gets results where they take less."""
END_TIME = 20.0
"""Longest wait for the thread when the work is closed [s]."""

Request = TypeVar("Request")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Progress:
    """Progress of the work."""

    what: str = ""
    """Name of what is worked on; empty before the first."""
    step: int = 0
    """Its number, from 1."""
    steps: int = 0
    """Number of all."""
    seconds: float = 0.0
    """Time since the work began, or since its last result [s]."""

    def describe(self) -> str:
        """Return the progress in words, such as "judging path 2 of 5"."""
        many = f" {self.step} of {self.steps}" if self.steps > 1 else ""
        return f"{self.what or 'waiting'}{many}"


Work = Callable[[Request], Iterator[Progress | Result]]
"""Yields what is begun, and the results of a request, each as soon as it is known."""


Take = Callable[[Request, Result | BaseException], object]
"""Takes a result of a request, or the error that ended it."""


class _StoppedError(Exception):
    """Leaves work that was cancelled or replaced."""


@dataclass(eq=False)
class _Job(Generic[Request]):
    """A request in the thread."""

    request: Request
    began: float
    is_stopped: bool = False
    has_result: bool = False


class BackgroundWork(Generic[Request, Result]):
    """Does one request at a time, the newest; those that a newer one replaces are dropped.

    A newer request stops work that has had PATIENCE, or has given its first result. The methods
    may be called from any thread.
    """

    def __init__(
        self, work: Work[Request, Result], take: Take[Request, Result], name: str = "background"
    ):
        """Start the thread.

        Args:
            work: Does a request. Between the slices of the model's sweeps it may be stopped by
                an error, which it must let pass; it is left at what it yields.
            take: Called in the thread with all that is found, in the order of the requests. It
                may wait until that was used.
            name: Name of the thread.
        """
        self._work, self._take = work, take
        self._changed = threading.Condition()
        # The lock of _changed guards all that follows.
        self._waiting: Request | None = None
        self._job: _Job[Request] | None = None
        self._progress = Progress()
        self._since = 0.0
        self._ending = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def ask(self, request: Request) -> None:
        """Do a request instead of the one that waits, and soon instead of the one in work."""
        with self._changed:
            if not self._is_busy():
                self._progress, self._since = Progress(), time.monotonic()
            self._waiting = request
            self._changed.notify()

    def cancel(self) -> bool:
        """Stop all work; what it finds after this is dropped. Return whether there was any."""
        with self._changed:
            was_busy = self._is_busy()
            self._waiting = None
            if self._job is not None:
                self._job.is_stopped = True
        return was_busy

    @property
    def progress(self) -> Progress | None:
        """Progress of the work; None if there is none."""
        with self._changed:
            if not self._is_busy():
                return None
            return replace(self._progress, seconds=time.monotonic() - self._since)

    def close(self) -> bool:
        """Stop all work and end the thread; return whether it has ended within END_TIME."""
        self.cancel()
        with self._changed:
            self._ending = True
            self._changed.notify()
        self._thread.join(END_TIME)
        return not self._thread.is_alive()

    def _is_busy(self) -> bool:
        in_work = self._job is not None and not self._job.is_stopped
        return in_work or self._waiting is not None

    def _run(self) -> None:
        while True:
            with self._changed:
                self._job = None
                self._changed.wait_for(lambda: self._waiting is not None or self._ending)
                if self._ending or self._waiting is None:
                    return
                job = self._job = _Job(self._waiting, time.monotonic())
                self._waiting = None
            self._do(job)

    def _do(self, job: _Job[Request]) -> None:
        def check() -> None:
            has_time = not job.has_result and time.monotonic() - job.began < PATIENCE
            if job.is_stopped or (self._waiting is not None and not has_time):
                raise _StoppedError("a newer request or a visitor stopped the work")

        try:
            with interruptible(check):
                for found in self._work(job.request):
                    if isinstance(found, Progress):
                        check()
                        with self._changed:
                            self._progress = found
                    else:
                        self._deliver(job, found)
                        check()
        except _StoppedError:
            return
        except BaseException as error:  # the thread must go on; whoever takes it tells of it
            if self._waiting is None:
                self._deliver(job, error)

    def _deliver(self, job: _Job[Request], found: Result | BaseException) -> None:
        """Hand over what was found, unless it was cancelled."""
        with self._changed:
            if job.is_stopped:
                return
            self._since, job.has_result = time.monotonic(), True
        self._take(job.request, found)
