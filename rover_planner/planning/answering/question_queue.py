# SPDX-License-Identifier: Apache-2.0
"""Judges questions one after another in a thread, each within its time budget."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from rover_physics.numerics.interruption import interruptible
from rover_planner.planning.answering.budget import BUSY, TOO_LONG, Budget, QuestionStoppedError
from rover_planner.planning.answering.questions import Question

HOPELESS = 0.02
"""Share of its time that a waiting question must have left to be worth waiting for."""
END_TIME = 2.0
"""Longest wait for the thread when the queue is closed [s]."""


@dataclass(eq=False)
class Asked:
    """A question that was asked."""

    question: Question
    """The question."""
    budget: Budget
    """Its time."""
    has_begun: bool = False
    """True if the thread has begun to judge it."""
    is_closed: bool = False
    """True if it has its judgement."""


Answered = tuple[Asked, Any]
"""A question and its judgement."""


class QuestionQueue:
    """Judges questions in their order; refuses those that it has no place or no time for.

    Its methods belong to one thread, the owner's. They return the questions that are to be
    answered, with their judgements; each question has one.
    """

    def __init__(self, max_waiting: int, judge: Callable[[Any], Any], wake: Callable[[], object]):
        """Start the thread.

        Args:
            max_waiting: Largest number of questions that wait while one is in work.
            judge: Returns the judgement of an `Asked`; called in the thread. It may raise
                QuestionStoppedError only.
            wake: Called in the thread when there are `finished` questions.
        """
        self.max_waiting = max_waiting
        self._judge, self._wake = judge, wake
        self._waiting: SimpleQueue[Asked | None] = SimpleQueue()
        self._judged: SimpleQueue[Answered] = SimpleQueue()
        self._open: list[Asked] = []
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    @property
    def open_count(self) -> int:
        """Number of questions without an answer."""
        return len(self._open)

    def ask(self, asked: Asked) -> list[Answered]:
        """Queue a question, or refuse it as BUSY."""
        if len(self._open) > self.max_waiting:
            reason = f"{len(self._open)} questions are open already; ask again later"
            return [(asked, asked.question.refuse(BUSY, reason))]
        self._open.append(asked)
        self._waiting.put(asked)
        return []

    def finished(self) -> list[Answered]:
        """Take what the thread has judged."""
        return self._take_open([self._judged.get() for _ in range(self._judged.qsize())])

    def overdue(self, grace: float) -> list[Answered]:
        """Refuse waiting questions just before their deadline, one in work `grace` [s] after."""
        refused = []
        for asked in self._open:
            budget = asked.budget
            if asked.has_begun and budget.remaining < -grace:
                refused.append((asked, _refuse_stopped(asked)))
            elif not asked.has_begun and budget.remaining < HOPELESS * budget.seconds:
                refused.append((asked, _refuse_waiting(asked)))
        return self._take_open(refused)

    def stop_all(self, code: str, reason: str) -> list[Answered]:
        """Stop all open questions with a code and reason."""
        for asked in self._open:
            asked.budget.stop(code, reason)
        return self._take_open(
            [(asked, asked.question.refuse(code, reason)) for asked in self._open]
        )

    def close(self) -> None:
        """End the thread; stop all questions before."""
        self._waiting.put(None)
        self._thread.join(END_TIME)

    def _take_open(self, answered: list[Answered]) -> list[Answered]:
        """Take questions from the open ones; return those that were open."""
        closed = [(asked, judgement) for asked, judgement in answered if not asked.is_closed]
        for asked, _ in closed:
            asked.is_closed = True
            self._open.remove(asked)
        return closed

    def _run(self) -> None:
        while (asked := self._waiting.get()) is not None:
            if not asked.is_closed:
                self._judged.put((asked, self._find(asked)))
                self._wake()

    def _find(self, asked: Asked) -> Any:
        """Return the judgement of a question, or its refusal."""
        if asked.budget.is_over:
            return _refuse_stopped(asked)
        asked.has_begun = True
        try:
            with interruptible(asked.budget.check):
                return self._judge(asked)
        except QuestionStoppedError as error:
            return asked.question.refuse(error.code, str(error))


def _refuse_stopped(asked: Asked) -> Any:
    """Return the refusal of a question that is over: stopped, not begun in time, or too long."""
    try:
        asked.budget.check()
    except QuestionStoppedError as error:
        if error.code == TOO_LONG and not asked.has_begun:
            return _refuse_waiting(asked)
        return asked.question.refuse(error.code, str(error))
    raise AssertionError("the question is not over")


def _refuse_waiting(asked: Asked) -> Any:
    """Return the refusal of a question that was not begun in time."""
    reason = f"others were in work for its time budget of {asked.budget.seconds:g} s; "
    return asked.question.refuse(BUSY, f"{reason}ask again later")
