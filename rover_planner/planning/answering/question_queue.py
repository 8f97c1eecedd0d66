"""Answers questions one after another in a thread, each within its time budget."""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rover_physics.numerics.interruption import interruptible
from rover_planner.planning.answering.budget import (
    BUSY,
    STOPPING,
    TOO_LONG,
    Budget,
    QuestionStoppedError,
)

HOPELESS = 0.02
"""Share of its time that a waiting question must have left to be worth waiting for."""
END_TIME = 2.0
"""Longest wait for the thread when the queue is closed [s]."""


@dataclass(eq=False)
class Question:
    """A question: how to answer it, how to refuse it, and where the answer goes."""

    answer: Callable[[Budget], Any]
    """Finds the answer; called in the thread; any error becomes a refusal."""
    refuse: Callable[[str, str], Any]
    """Makes an answer of a refusal's code and reason."""
    fail: Callable[[Exception], Any]
    """Makes an answer of an error that `answer` raised."""
    deliver: Callable[[Any], None]
    """Sends the answer; called by `QuestionQueue.deliver`, once."""
    budget: Budget
    """Its time."""
    has_begun: bool = False
    """Whether the thread has begun to answer it."""
    is_delivered: bool = False
    """Whether the answer was sent."""


class QuestionQueue:
    """Answers questions in their order; refuses those that it has no place or no time for.

    `ask`, `deliver`, `refuse_overdue` and `stop_all` belong to one thread, the owner's.
    """

    def __init__(self, max_waiting: int, wake: Callable[[], object]):
        """Start the thread.

        Args:
            max_waiting: Largest number of questions that wait while one is in work.
            wake: Called in the thread when an answer is ready for `deliver`.
        """
        self.max_waiting = max_waiting
        self._wake = wake
        self._waiting: deque[Question] = deque()
        self._answered: deque[tuple[Question, Any]] = deque()
        self._open: list[Question] = []
        self._changed = threading.Condition()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    @property
    def open_count(self) -> int:
        """Number of questions without an answer."""
        return len(self._open)

    def ask(self, question: Question) -> None:
        """Queue a question, or refuse it as BUSY."""
        if len(self._open) > self.max_waiting:
            reason = f"{len(self._open)} questions are open already; ask again later"
            question.deliver(question.refuse(BUSY, reason))
            return
        self._open.append(question)
        with self._changed:
            self._waiting.append(question)
            self._changed.notify()

    def deliver(self) -> None:
        """Send all answers that are ready."""
        while self._answered:
            self._send(*self._answered.popleft())

    def refuse_overdue(self, grace: float) -> None:
        """Refuse waiting questions just before their deadline, one in work `grace` [s] after."""
        for question in list(self._open):
            budget = question.budget
            if question.has_begun and budget.remaining < -grace:
                self._send(question, _refuse_stopped(question))
            elif not question.has_begun and budget.remaining < HOPELESS * budget.seconds:
                self._send(question, _refuse_waiting(question))

    def stop_all(self, code: str, reason: str) -> int:
        """Stop all open questions with a code and reason; return their number."""
        questions = list(self._open)
        for question in questions:
            question.budget.stop(code, reason)
            self._send(question, question.refuse(code, reason))
        return len(questions)

    def close(self) -> None:
        """Stop all questions and end the thread."""
        self.stop_all(STOPPING, "the server is shutting down")
        with self._changed:
            self._ending = True
            self._changed.notify()
        self._thread.join(END_TIME)

    def _send(self, question: Question, answer: Any) -> None:
        if not question.is_delivered:
            question.is_delivered = True
            self._open.remove(question)
            question.deliver(answer)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ending)
                if self._ending:
                    return
                question = self._waiting.popleft()
            if not question.is_delivered:
                self._answered.append((question, _answer(question)))
                self._wake()


def _answer(question: Question) -> Any:
    """Return the answer to a question, or its refusal."""
    if question.budget.is_over:
        return _refuse_stopped(question)
    question.has_begun = True
    try:
        with interruptible(question.budget.check):
            return question.answer(question.budget)
    except QuestionStoppedError as error:
        return question.refuse(error.code, str(error))
    except Exception as error:
        return question.fail(error)


def _refuse_stopped(question: Question) -> Any:
    """Return the refusal of a question that is over: stopped, not begun in time, or too long."""
    try:
        question.budget.check()
    except QuestionStoppedError as error:
        if error.code == TOO_LONG and not question.has_begun:
            return _refuse_waiting(question)
        return question.refuse(error.code, str(error))
    raise AssertionError("the question is not over")


def _refuse_waiting(question: Question) -> Any:
    """Return the refusal of a question that was not begun in time."""
    seconds = question.budget.seconds
    reason = f"others were in work for its time budget of {seconds:g} s; ask again later"
    return question.refuse(BUSY, reason)
