# SPDX-License-Identifier: Apache-2.0
"""Judges questions one after another in a thread, each within its time budget."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from rover_physics.errors import RoverError
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
    answer: Callable[[Any], object]
    """Takes its judgement; called once, in the thread that asks."""
    has_begun: bool = False
    """True if the thread has begun to judge it."""
    is_closed: bool = False
    """True if it has its judgement."""


class QuestionQueue:
    """Judges questions in their order; refuses those that it has no place or no time for.

    Its methods belong to one thread, the owner's. Within them each question is answered, once.
    """

    def __init__(
        self,
        judge: Callable[[Any], Any],
        call: Callable[[Callable[[], None]], object],
        report: Callable[[str, Exception], str],
    ):
        """Start the thread.

        Args:
            judge: Returns the judgement of an `Asked`; called in the thread. It may raise: a
                RoverError refuses the request, any other error is one of this program.
            call: Has the owner's thread call `finish`; called in the thread.
            report: Takes the place of an error of this program and the error; returns its text.
        """
        self._judge, self._call, self._report = judge, call, report
        self._waiting: SimpleQueue[Asked | None] = SimpleQueue()
        self._judged: SimpleQueue[tuple[Asked, Any]] = SimpleQueue()
        self._open: list[Asked] = []
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    @property
    def open_count(self) -> int:
        """Number of questions without an answer."""
        return len(self._open)

    def ask(self, asked: Asked, max_waiting: int) -> None:
        """Queue a question, or refuse it as BUSY if more than that number wait."""
        count = len(self._open)
        self._open.append(asked)
        if count > max_waiting:
            self._refuse(asked, BUSY, f"{count} questions are open already; ask again later")
        else:
            self._waiting.put(asked)

    def finish(self) -> None:
        """Answer what the thread has judged."""
        for _ in range(self._judged.qsize()):
            self._close(*self._judged.get())

    def refuse_overdue(self, grace: float) -> None:
        """Refuse waiting questions just before their deadline, one in work `grace` [s] after."""
        for asked in list(self._open):
            budget = asked.budget
            least = -grace if asked.has_begun else HOPELESS * budget.seconds
            if budget.remaining < least:
                self._close(asked, _refuse_late(asked))

    def stop_all(self, code: str, reason: str) -> int:
        """Stop all open questions with a code and reason; return their number."""
        stopped = list(self._open)
        for asked in stopped:
            asked.budget.stop(code, reason)
            self._refuse(asked, code, reason)
        return len(stopped)

    def close(self) -> None:
        """End the thread; stop all questions before."""
        self._waiting.put(None)
        self._thread.join(END_TIME)

    def _refuse(self, asked: Asked, code: str, reason: str) -> None:
        self._close(asked, asked.question.refuse(code, reason))

    def _close(self, asked: Asked, judgement: Any) -> None:
        """Answer a question that is open."""
        if not asked.is_closed:
            asked.is_closed = True
            self._open.remove(asked)
            asked.answer(judgement)

    def _run(self) -> None:
        while (asked := self._waiting.get()) is not None:
            if not asked.is_closed:
                self._judged.put((asked, self._find(asked)))
                self._call(self.finish)

    def _find(self, asked: Asked) -> Any:
        """Return the judgement of a question, or its refusal."""
        if asked.budget.stopped is not None:
            return _refuse_late(asked)
        asked.has_begun = True
        try:
            with interruptible(asked.budget.check):
                return self._judge(asked)
        except QuestionStoppedError as error:
            return asked.question.refuse(error.code, str(error))
        except RoverError as error:
            return asked.question.refuse("bad_request", str(error))
        except Exception as error:
            text = self._report(asked.question.service, error)
            return asked.question.refuse("internal_error", f"internal error: {text}")


def _refuse_late(asked: Asked) -> Any:
    """Return the refusal of a question that was stopped, not begun in time, or took too long."""
    stopped = asked.budget.stopped
    if stopped is not None and (asked.has_begun or stopped.code != TOO_LONG):
        return asked.question.refuse(stopped.code, str(stopped))
    reason = f"others were in work for its time budget of {asked.budget.seconds:g} s; "
    return asked.question.refuse(BUSY, f"{reason}ask again later")
