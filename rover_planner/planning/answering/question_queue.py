# SPDX-License-Identifier: Apache-2.0
"""Judges questions one after another in a thread, each within its time budget."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Generic, TypeVar

from rover_physics.errors import RoverError
from rover_physics.numerics.interruption import interruptible
from rover_planner.planning.answering.budget import BUSY, TOO_LONG, Budget, QuestionStoppedError
from rover_planner.planning.answering.judgement import PathJudgement, refusal, refuse_for

HOPELESS = 0.02
"""Share of its time that a waiting question must have left to be worth waiting for."""
END_TIME = 2.0
"""Longest wait for the thread when the queue is closed [s]."""


@dataclass(eq=False)
class Asked:
    """A question that was asked."""

    service: str
    """Name of the service that was asked."""
    budget: Budget
    """Its time."""
    has_begun: bool = False
    """True if the thread has begun to judge it."""


One = TypeVar("One", bound=Asked)
Judgement = TypeVar("Judgement")


class QuestionQueue(Generic[One, Judgement]):
    """Judges questions in their order; refuses those that it has no place or no time for.

    Its methods belong to one thread, the owner's. Each question has one answer: its judgement, or
    a refusal, whichever comes first.
    """

    def __init__(
        self,
        judge: Callable[[One], Judgement],
        wake: Callable[[], object],
        report: Callable[[str, Exception], str],
    ):
        """Start the thread.

        Args:
            judge: Returns the judgement of a question; called in the thread. It may raise: a
                RoverError refuses the request, any other error is one of this program.
            wake: Has the owner's thread take the answers; called in the thread.
            report: Takes the place of an error of this program and the error; returns its text.
        """
        self._judge, self._wake, self._report = judge, wake, report
        self._waiting: SimpleQueue[One | None] = SimpleQueue()
        self._answers: SimpleQueue[tuple[One, Judgement | PathJudgement]] = SimpleQueue()
        self._open: list[One] = []
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    @property
    def open_count(self) -> int:
        """Number of questions whose answer was not taken."""
        return len(self._open)

    def ask(self, asked: One, max_waiting: int) -> None:
        """Queue a question, or refuse it as BUSY if more than that number wait."""
        count = len(self._open)
        self._open.append(asked)
        if count > max_waiting:
            reason = f"{count} questions are open already; ask again later"
            self._answers.put((asked, refusal(BUSY, reason)))
        else:
            self._waiting.put(asked)

    def take_answers(self) -> list[tuple[One, Judgement | PathJudgement]]:
        """Return the questions that have got an answer since the last call, each with it."""
        taken = []
        for _ in range(self._answers.qsize()):
            asked, judgement = self._answers.get()
            if asked in self._open:
                self._open.remove(asked)
                taken.append((asked, judgement))
        return taken

    def refuse_overdue(self, grace: float) -> None:
        """Refuse waiting questions just before their deadline, one in work `grace` [s] after."""
        for asked in self._open:
            budget = asked.budget
            least = -grace if asked.has_begun else HOPELESS * budget.seconds
            if budget.remaining < least:
                self._answers.put((asked, _refuse_late(asked)))

    def stop_all(self, code: str, reason: str) -> int:
        """Refuse all open questions with a code and reason; return their number."""
        for asked in self._open:
            asked.budget.stop(code, reason)
            self._answers.put((asked, refusal(code, reason)))
        return len(self._open)

    def close(self) -> None:
        """End the thread; stop all questions before."""
        self._waiting.put(None)
        self._thread.join(END_TIME)

    def _run(self) -> None:
        while (asked := self._waiting.get()) is not None:
            if asked in self._open:
                self._answers.put((asked, self._find(asked)))
                self._wake()

    def _find(self, asked: One) -> Judgement | PathJudgement:
        """Return the judgement of a question, or its refusal."""
        if asked.budget.stopped is not None:
            return _refuse_late(asked)
        asked.has_begun = True
        try:
            with interruptible(asked.budget.check):
                return self._judge(asked)
        except QuestionStoppedError as error:
            return refusal(error.code, str(error))
        except RoverError as error:
            return refusal("bad_request", str(error))
        except Exception as error:
            return refuse_for(self._report(asked.service, error))


def _refuse_late(asked: Asked) -> PathJudgement:
    """Return the refusal of a question that was stopped, not begun in time, or took too long."""
    stopped = asked.budget.stopped
    if stopped is not None and (asked.has_begun or stopped.code != TOO_LONG):
        return refusal(stopped.code, str(stopped))
    reason = f"others were in work for its time budget of {asked.budget.seconds:g} s; "
    return refusal(BUSY, f"{reason}ask again later")
