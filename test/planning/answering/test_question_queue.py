# SPDX-License-Identifier: Apache-2.0
"""Questions are answered in order, within their time, once, or refused with the reason."""

import threading
import time
from collections.abc import Callable
from unittest.mock import Mock

import pytest

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
from rover_planner.planning.answering.questions import Asked, QuestionQueue
from support.waiting import wait_until


class Desk:
    """A queue of works by name, with a clock of its own; collects judgements, or codes."""

    def __init__(self):
        self.told: list[tuple[str, object]] = []
        self.reasons: list[str] = []
        self.works: dict[str, Callable[[Budget], object]] = {}
        self.max_waiting, self.now, self.begun = 100, 0.0, threading.Event()
        self.queue = QuestionQueue[Asked, object](
            lambda asked: self.works[asked.service](asked.budget),
            lambda: None,
            lambda place, error: f"{place}: {error!r}",
        )

    def ask(self, name, work, seconds=1.0) -> None:
        self.works[name] = work
        self.queue.ask(Asked(name, Budget(seconds, lambda: self.now)), self.max_waiting)

    def work_on(self, _budget: Budget) -> None:
        """Work until the budget ends it, of which work such as a sweep knows nothing."""
        self.begun.set()
        while True:
            check_interruption()
            time.sleep(0.001)

    def wait(self, count: int) -> list[tuple[str, object]]:
        def enough() -> bool:
            for asked, found in self.queue.take_answers():
                self.told.append((asked.service, getattr(found, "code", found)))
                self.reasons.append(getattr(found, "reason", ""))
            return len(self.told) >= count

        wait_until(enough, f"{count} answers")
        return self.told


@pytest.fixture
def desk():
    made = Desk()
    yield made
    made.queue.stop_all(STOPPING, "")
    made.queue.close()


def test_beyond_the_queue_the_answer_is_busy_at_once_and_who_waits_gets_one_in_its_time(desk):
    desk.max_waiting = 2
    desk.ask("works", desk.work_on)
    assert desk.begun.wait(20.0)
    desk.ask("waits", lambda _: 5, seconds=20.0)
    desk.ask("waits too long", lambda _: 5)
    desk.ask("too many", lambda _: 6)
    assert desk.wait(1) == [("too many", BUSY)]
    desk.now = 2.0
    assert desk.wait(4)[1:] == [("works", TOO_LONG), ("waits", 5), ("waits too long", BUSY)]


def test_work_that_checks_nothing_is_refused_after_its_grace_and_its_answer_is_dropped(desk):
    go_on = threading.Event()
    desk.ask("deaf", lambda _: desk.begun.set() or go_on.wait(60.0))
    assert desk.begun.wait(20.0)
    desk.ask("waiting", desk.work_on)
    desk.now = 2.0
    desk.queue.refuse_overdue(10.0)
    assert desk.wait(1) == [("waiting", BUSY)]  # it never began, and needs no grace
    desk.queue.refuse_overdue(0.5)
    assert desk.wait(2) == [("waiting", BUSY), ("deaf", TOO_LONG)]
    go_on.set()
    desk.ask("next", lambda _: 5)
    assert desk.wait(3)[2:] == [("next", 5)] and desk.queue.open_count == 0


def test_errors_of_the_input_are_bad_requests_and_others_internal_errors(desk):
    for name, error in (("one", PoseError("no pose")), ("two", KeyError("k"))):
        desk.ask(name, Mock(side_effect=error))
    assert desk.wait(2) == [("one", "bad_request"), ("two", "internal_error")]
    assert desk.reasons == ["no pose", "internal error: two: KeyError('k')"]


def test_all_open_questions_can_be_cancelled(desk):
    desk.ask("one", desk.work_on)
    desk.ask("two", desk.work_on)
    assert desk.queue.stop_all(CANCELLED, "told so") == 2
    assert desk.wait(2) == [("one", CANCELLED), ("two", CANCELLED)]
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
