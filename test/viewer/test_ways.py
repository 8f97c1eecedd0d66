# SPDX-License-Identifier: Apache-2.0
"""Ways around obstacles on the page, without a browser: searched, shown, cancelled, explained."""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest

from rover_physics.names import TORQUE_POLICIES
from rover_physics.traversability.judge import judge_path
from rover_planner.planning.ways.way_search import FOUND, NO_WAY, OUT_OF_TIME
from rover_planner.viewer.state.background_work import Progress
from rover_planner.viewer.state.judging import (
    BETTER,
    PATH,
    POLICY,
    WAY,
    JudgeRequest,
    judge_request,
)
from rover_planner.viewer.state.scenario import Shown
from rover_planner.viewer.state.session import ViewSession
from support.grounds import wall_with_gap, whole_wall
from support.viewer.sessions import LSR1, held, walled_session
from support.waiting import wait_until

GOAL = (1.6, 0.0, 0.0)
"""A pose on the other side of the wall."""
BEYOND = np.array(GOAL[:2])
"""Its place [m]."""
FRICTION = [("friction",)]


def plan_beyond(height) -> tuple[ViewSession, list]:
    """Return a session that has planned beyond a wall, and the steps of its judgement."""
    session = walled_session(height, ends_at_first=False)
    steps: list = []
    judge = session._judge

    def note(request):
        for step in judge(request):
            steps.append(step)
            yield step

    session._judge = note
    assert session.plan_to(BEYOND)
    return session, steps


@pytest.fixture(scope="module")
def through() -> tuple[ViewSession, list]:
    """A session with a way through the gap, and its steps; tests do not change them."""
    return plan_beyond(wall_with_gap)


@pytest.fixture(scope="module")
def found(through) -> ViewSession:
    return through[0]


@pytest.fixture(scope="module")
def before_wall() -> tuple[ViewSession, list]:
    """A session that has found no way, and its steps; tests do not change them."""
    return plan_beyond(whole_wall)


@pytest.fixture(scope="module")
def closed(before_wall) -> ViewSession:
    return before_wall[0]


def describe(steps: list) -> list:
    """Return what is begun and how many candidates each result has."""
    return [
        step.what if isinstance(step, Progress) else len(step.answer.candidates) for step in steps
    ]


def test_beyond_a_wall_with_a_gap_a_way_follows_the_refused_candidates_and_is_shown(found):
    *direct, way = found.shown.candidates
    assert len(direct) == 5 and not any(one.verdict.traversable for one in direct)
    assert found.shown.way.outcome == FOUND
    assert found.shown.index == found.shown.answer.best == found.shown.answer.nearest == 5
    assert found.shown.candidate is way
    poses = way.poses
    np.testing.assert_allclose(poses[[0, -1], :2], [found.scenario.start[:2], BEYOND], atol=1e-9)
    assert np.all(poses[np.abs(poses[:, 0]) < 0.2, 1] > 1.0)
    model = found.scenario.asked_options.model
    assert judge_path(LSR1, found.terrain, poses, model)[1].traversable
    shown = found.shown
    assert [one.policy for one in shown.by_policy] == list(TORQUE_POLICIES)
    assert not any(one.is_old for one in shown.by_policy)
    assert f"way of {shown.candidate.length:.1f} m around" in shown.summary


def test_where_there_is_no_way_the_closed_area_and_the_reason_are_kept(closed):
    way = closed.shown.way
    assert way.outcome == NO_WAY and len(closed.shown.candidates) == 5
    assert not closed.shown.verdict.traversable
    reason = closed.shown.reason
    assert reason.startswith("no way within the map: ") and "closed in by: " in reason
    assert reason.endswith(closed.shown.verdict.reason)
    ends = [
        value_at(way, way.closed.places, pose)
        for pose in (closed.scenario.start, closed.scenario.goal)
    ]
    assert ends == [not way.closed.around_goal, way.closed.around_goal]
    assert 0 < way.asked.sum() < way.asked.size
    assert value_at(way, way.asked, (0.0, 0.0))  # the wall between the ends


def value_at(way, places, pose) -> bool:
    """Return the value of places (rows, columns) at a pose."""
    column, row = np.rint(np.array(pose[:2]) / way.nodes.cell).astype(int) - way.nodes.first
    return bool(places[row, column])


def test_the_search_follows_paths_and_policies(through, before_wall):
    begin, way = [*[PATH] * 5, 5, *[POLICY] * 3, 5, WAY], [6, *[POLICY] * 3, 6]
    assert describe(before_wall[1]) == [*begin, 5]
    steps = describe(through[1])
    assert steps in ([*begin, *way, BETTER], [*begin, *way, BETTER, *way])


def test_the_first_way_is_shown_at_once_and_replaced_only_by_a_better_one(through):
    judged = [step for step in through[1] if isinstance(step, Shown)]
    ways = [one.way for one in judged if one.way is not None]
    costs = [one.cost for one in ways]
    assert all(one.outcome == FOUND and one.path.verdict.traversable for one in ways)
    assert costs == sorted(costs, reverse=True)
    assert ways[0].edges_judged <= ways[-1].edges_judged
    assert len(judged[-1].answer.candidates) == 6


def test_nothing_is_searched_where_a_candidate_passes_off_the_map_or_for_a_recorded_path():
    session = walled_session(wall_with_gap)
    for goal, passes in (((-1.1, 0.1), True), ((9.0, 0.0), False)):
        assert session.plan_to(np.array(goal))
        assert session.shown.way is None and session.shown.answer.traversable == passes
        assert WAY not in describe(list(judge_request(JudgeRequest(session.wanted))))
    assert session.plan_to(np.array([-1.1, 0.1]))
    session.replay(session.shown.candidate.prediction, session.shown.verdict.reasons)
    assert session.change_rover(FRICTION, 0.05) and session.plan_again()
    assert not session.shown.verdict.traversable and session.shown.way is None


def test_a_search_that_runs_out_of_time_says_that_there_may_be_a_way(closed):
    short = dataclasses.replace(closed.wanted.search, budget=0.01)
    hurried = dataclasses.replace(closed.wanted, search=short)
    *_, judged = judge_request(JudgeRequest(hurried))
    assert judged.way.outcome == OUT_OF_TIME and judged.way.closed is None
    assert "there may be one" in judged.reason


def test_a_slider_judges_the_shown_way_again_and_then_searches_another():
    session = walled_session(wall_with_gap)
    session.plan_to(BEYOND)
    poses, way = session.shown.candidate.poses, session.shown.way
    assert session.change_rover(FRICTION, 0.7)
    assert session.shown.index == 5 and session.shown.way is way
    np.testing.assert_array_equal(session.shown.candidate.poses, poses)
    assert session.plan_again()
    assert session.shown.index == 5 and session.shown.way is not way
    assert session.shown.verdict.traversable


# In the background.


@pytest.fixture
def session() -> Iterator[ViewSession]:
    """A session before a wall with a gap that judges in the background."""
    made = walled_session(wall_with_gap)
    made.judge_in_background(lambda: None)
    yield made
    assert made.close()


def finish(session: ViewSession) -> None:
    wait_until(lambda: session.progress is None, "the end of the work", 60.0)
    session.take_finished()


@contextmanager
def searching(session: ViewSession) -> Iterator[None]:
    """Plan beyond the wall, take what is finished before the search, and let that go on later."""
    with held(session._background, WAY):
        assert session.plan_to(BEYOND)
        wait_until(lambda: session.progress.what == WAY, "the search", 60.0)
        assert session.progress.describe() == "searching a way"
        session.take_finished()
        yield


def test_while_a_way_is_searched_the_verdict_on_the_candidates_is_there(session):
    with searching(session):
        assert not session.is_outdated and len(session.shown.candidates) == 5
        assert not session.shown.verdict.traversable
        other = 1 if session.shown.index != 1 else 2
        assert session.show_candidate(other)  # it stays, and the way is listed
    finish(session)
    assert session.shown.index == other and len(session.shown.candidates) == 6
    assert session.shown.answer.nearest == 5 and session.shown.candidates[5].verdict.traversable
    assert session.show_candidate(5)
    finish(session)
    assert session.shown.verdict.traversable


def test_a_cancelled_search_leaves_the_verdict_on_the_candidates_and_can_be_begun_again(session):
    with searching(session):
        shown = session.shown
        session.cancel()
        session.take_finished()
        assert session.is_stopped and session.shown is shown and session.shown.way is None
    assert session.plan_again()
    finish(session)
    assert session.shown.way.outcome == FOUND


def test_the_way_of_a_rover_that_slips_is_no_candidate_once_it_can_climb_the_wall():
    slippery = dataclasses.replace(LSR1, friction=0.35)
    session = walled_session(partial(wall_with_gap, height=0.05), GOAL, slippery)
    session.judge_in_background(lambda: None)
    try:
        finish(session)
        assert session.shown.index == 5
        session.change_rover(FRICTION, 1.5)
        finish(session)
        session.plan_again()
        wait_until(lambda: session.progress is None, "all candidates", 60.0)  # and not taken yet
        session.change_rover(FRICTION, 1.4)
        session.take_finished()
        session.change_rover(FRICTION, 1.3)
        finish(session)
        assert not session.is_outdated and session.rover.friction == 1.3
        assert session.shown.candidates[session.shown.index].verdict.traversable
        session.plan_again()
        finish(session)
        assert len(session.shown.candidates) == 5 and session.shown.answer.traversable
    finally:
        assert session.close()


def test_a_session_that_begins_before_a_wall_searches_as_soon_as_it_has_a_thread():
    session = walled_session(wall_with_gap, GOAL)
    assert session.shown.needs_way and len(session.shown.candidates) == 5
    session.judge_in_background(lambda: None)
    try:
        finish(session)
        assert session.shown.index == 5 and session.shown.verdict.traversable
    finally:
        assert session.close()
