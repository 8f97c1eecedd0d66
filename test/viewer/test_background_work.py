# SPDX-License-Identifier: Apache-2.0
"""Work in the background with a real rover on a real map: newest wins, cancel, error, progress."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.judge import PathJudge
from rover_planner.viewer.state.background_work import BackgroundWork, WorkStep
from rover_planner.viewer.state.judging import PATH, judge_steps
from support.grounds import waves
from support.viewer.sessions import Judge, ramp, session_on
from support.waiting import wait_until

STOP_TIME = 2.0
"""Longest time until work stops [s]; most steps take 0.05 s, few 0.4 s."""
MANY = PathQueryOptions(count=3, spacing=0.2, waypoint_spacing=5e-5)
SLOW = session_on(waves, options=MANY).wanted
"""Three paths with so many waypoints that each takes a while."""


def judge_without_end():
    """Judge SLOW again and again, without a result."""
    while True:
        yield from (one for one in judge_steps(SLOW) if isinstance(one, WorkStep))


@pytest.fixture
def found() -> list:
    """What work has found: results or errors."""
    return []


@pytest.fixture
def work(found):
    """Work that must end, although `judge_without_end` does not by itself."""
    made = BackgroundWork(lambda _, one: found.append(one))
    yield made
    assert made.close()


def wait_for_idle(work) -> None:
    wait_until(lambda: work.progress is None, "the end of the work", 60.0)


def test_a_newer_request_stops_at_once_what_follows_a_result(work, found):
    steps = {"old": 0}

    def count_steps():
        yield "old"
        while steps["old"] < 1000:
            steps["old"] += 1
            yield WorkStep("step", 1, 1)
            time.sleep(0.005)

    work.ask(count_steps())
    wait_until(lambda: steps["old"] > 3, "the old work to begin")
    work.ask(iter(["new", "last"]))
    asked_at = steps["old"]
    wait_for_idle(work)
    assert steps["old"] <= asked_at + 2
    assert found == ["old", "new", "last"]


def test_a_first_result_waits_for_no_older_work_and_what_follows_it_does(work, found):
    go_on = threading.Event()

    def work_on(number):
        yield number
        go_on.wait()
        yield f"rest of {number}"

    for number in (1, 2, 3):
        work.ask(work_on(number))
        assert work.progress.seconds < 0.5  # it does not count from an older result
        wait_until(lambda count=number: len(found) == count, "the verdict")
        wait_until(lambda: work.progress.seconds > 0.5, "time without a result")
    assert found == [1, 2, 3]
    go_on.set()
    wait_for_idle(work)
    assert found[3:] == ["rest of 3"]


@pytest.mark.timed
def test_cancelled_work_stops_soon_and_is_never_delivered(work, found):
    quick = session_on(ramp).wanted
    work.ask(judge_without_end())
    wait_until(lambda: work.progress.step == 2, "the second path")
    assert work.progress.describe() == f"{PATH} 2 of 3"
    began = time.monotonic()
    assert work.cancel()
    assert work.progress is None and not work.cancel()
    work.ask(judge_steps(quick))
    wait_until(lambda: work.progress is None or work.progress.what, "the next work")
    assert time.monotonic() - began < STOP_TIME
    wait_for_idle(work)
    assert {shown.scenario for shown in found} == {quick}
    work.ask(judge_without_end())
    wait_until(lambda: work.progress.what, "the work to begin")
    began = time.monotonic()
    assert work.close()
    assert time.monotonic() - began < STOP_TIME


@pytest.mark.parametrize("error", [MemoryError(), SystemExit(3)])
def test_an_error_is_delivered_and_what_is_asked_next_is_done(error, work, found):
    def fail():
        raise error
        yield

    for steps in (fail(), iter(["answer"])):
        work.ask(steps)
        wait_for_idle(work)
    assert found == [error, "answer"]


def test_a_process_ends_although_work_runs_in_it():
    code = (
        "import itertools, time\n"
        "from rover_planner.viewer.state.background_work import BackgroundWork, WorkStep\n"
        "work = BackgroundWork(print)\n"
        "work.ask(itertools.repeat(WorkStep('on', 1, 1)))\n"
        "while not work.progress.what: time.sleep(0.01)\n"
        "print('end', flush=True)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "end\n", "")


# The session in the background.


@pytest.fixture
def judge():
    """Judges in the background for a session on a ramp."""
    with Judge(session_on(ramp)) as made:
        yield made


def test_changes_add_up_and_no_old_path_is_chosen_while_others_are_planned(judge):
    session = judge.session
    session.plan_to(np.array([1.5, 0.5]))
    with pytest.raises(PlanningError, match="the listed paths are old"):
        session.show_path(1)
    session.change_rover([("friction",)], 0.5)
    session.take_change(session.wanted.change_options(joint_angles={"arm_yaw": 0.3}))
    session.take_change(session.wanted.change_options(soil="dry_sand"))
    judge.finish()
    asked = session.shown.scenario
    assert asked is session.wanted and session.is_complete
    assert asked.goal[:2] == (1.5, 0.5) and asked.rover.friction == 0.5
    assert asked.arm["arm_yaw"] == 0.3 and asked.options.model.soil == "dry_sand"
    answer = PathJudge(asked.site).search(asked.start, asked.goal)
    shown, planned = session.shown.paths, answer.candidates
    assert [repr(p.verdict) for p in shown] == [repr(c.verdict) for c in planned]


def test_an_error_of_the_judgement_is_raised_and_stops_it(judge):
    judge.session.take_change(judge.session.wanted.change_options(map_sigmas="many"))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="many"):
        judge.finish()
    assert judge.session.is_outdated and judge.session.is_stopped
