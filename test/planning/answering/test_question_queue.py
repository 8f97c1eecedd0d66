# SPDX-License-Identifier: Apache-2.0
"""Questions are answered in order, within their time, once, or refused with the reason."""

import threading
import time
from unittest.mock import Mock

import numpy as np
import pytest

from rover_physics import judge_path, load_rover
from rover_physics.errors import PoseError
from rover_physics.numerics.interruption import check_interruption
from rover_planner.planning.answering.budget import (
    BUSY,
    CANCELLED,
    STOPPING,
    TOO_LONG,
    Budget,
    QuestionStoppedError,
)
from rover_planner.planning.answering.question_queue import Asked, QuestionQueue
from rover_planner.planning.answering.questions import Question
from support.grounds import make_terrain, waves
from support.waiting import wait_until


class Work:
    """Work that takes all the time of its question, which begins when the work does.

    A thread that is late makes no difference: a question that has not begun in time is busy.
    """

    def __init__(self, answer):
        self.begun, self._answer, self._began = threading.Event(), answer, 0.0

    def __call__(self, budget: Budget) -> object:
        self._began = time.monotonic()
        self.begun.set()
        return self._answer(budget)

    def clock(self) -> float:
        """Return the time since the work began [s]; 0 before."""
        return time.monotonic() - self._began if self.begun.is_set() else 0.0


class Desk:
    """A queue whose judgements are collected as (name, judgement)."""

    def __init__(self):
        self.told: list[tuple[str, object]] = []
        self.max_waiting = 100
        self.queue = QuestionQueue(
            lambda asked: asked.question.judge(asked.budget),
            lambda _finish: None,
            lambda place, error: f"{place}: {error!r}",
        )

    def ask(
        self, name, work, seconds=20.0, clock=time.monotonic, refuse=lambda code, _: code
    ) -> None:
        def answer(judgement) -> None:
            self.told.append((name, judgement))

        asked = Asked(Question(name, "", work, refuse), Budget(seconds, clock), answer)
        self.queue.ask(asked, self.max_waiting)

    def work(self, name, answer, seconds: float) -> Work:
        """Ask a question whose time begins with the work on it."""
        work = Work(answer)
        self.ask(name, work, seconds, work.clock)
        return work

    def wait(self, count: int) -> list[tuple[str, object]]:
        def enough() -> bool:
            self.queue.finish()
            return len(self.told) >= count

        wait_until(enough, f"{count} answers")
        return self.told


@pytest.fixture
def desk():
    made = Desk()
    yield made
    made.queue.stop_all(STOPPING, "")
    made.queue.close()


def work_on(budget: Budget) -> None:
    """Work until the budget ends it."""
    while True:
        budget.check()
        time.sleep(0.001)


def test_a_sweep_stops_at_the_deadline_of_its_question(desk):
    rover, ground = load_rover("lsr1"), make_terrain(waves)
    poses = np.zeros((2_000_000, 3))
    desk.work("sweep", lambda _: judge_path(rover, ground, poses)[0], seconds=0.3)
    assert desk.wait(1) == [("sweep", TOO_LONG)]


def test_a_question_that_never_began_is_busy(desk):
    first = desk.work("first", work_on, seconds=0.2)
    desk.ask("second", lambda _: 5, seconds=0.1, clock=first.clock)
    assert desk.wait(2) == [("first", TOO_LONG), ("second", BUSY)]


def test_beyond_the_queue_the_answer_is_busy_at_once(desk):
    desk.max_waiting = 1
    assert desk.work("works", work_on, seconds=0.5).begun.wait(20.0)
    desk.ask("waits", lambda _: 5, seconds=20.0)
    desk.ask("too many", lambda _: 6)
    assert desk.told == [("too many", BUSY)]
    assert sorted(desk.wait(3)[1:]) == [("waits", 5), ("works", TOO_LONG)]


def test_work_that_checks_nothing_is_refused_after_its_grace_and_its_answer_is_dropped(desk):
    go_on = threading.Event()
    deaf = desk.work("deaf", lambda _: go_on.wait(60.0), seconds=0.05)
    assert deaf.begun.wait(20.0)
    desk.ask("waiting", work_on, seconds=0.05)
    time.sleep(0.1)
    desk.queue.refuse_overdue(10.0)
    assert desk.told == [("waiting", BUSY)]  # it never began, and needs no grace
    desk.queue.refuse_overdue(0.02)
    assert desk.told == [("waiting", BUSY), ("deaf", TOO_LONG)]
    go_on.set()
    desk.ask("next", lambda _: 5)
    assert desk.wait(3)[2:] == [("next", 5)] and desk.queue.open_count == 0


def test_errors_of_the_input_are_bad_requests_and_others_internal_errors(desk):
    for name, error in (("one", PoseError("no pose")), ("two", KeyError("k"))):
        desk.ask(name, Mock(side_effect=error), refuse=lambda *both: both)
    first, second = (told for _, told in desk.wait(2))
    assert first == ("bad_request", "no pose")
    assert second == ("internal_error", "internal error: two: KeyError('k')")


def test_all_open_questions_can_be_cancelled(desk):
    desk.ask("one", work_on)
    desk.ask("two", work_on)
    assert desk.queue.stop_all(CANCELLED, "told so") == 2
    assert desk.told == [("one", CANCELLED), ("two", CANCELLED)]
    desk.ask("next", lambda _: 5)
    assert desk.wait(3)[2] == ("next", 5)
    desk.queue.close()
    wait_until(lambda: not desk.queue._thread.is_alive(), "the end of the thread")


def test_a_budget_tells_why_it_stopped_and_the_first_reason_counts():
    now = [0.0]
    budget = Budget(2.0, lambda: now[0])
    budget.check()
    assert budget.remaining == 2.0 and budget.stopped is None
    now[0] = 2.5
    with pytest.raises(QuestionStoppedError, match="time budget of 2 s") as stopped:
        budget.check()
    budget.stop(CANCELLED, "later")
    assert stopped.value.code == TOO_LONG and budget.stopped is stopped.value
    with pytest.raises(QuestionStoppedError, match="time budget"):
        budget.check()
    check_interruption()  # outside a question nothing stops
