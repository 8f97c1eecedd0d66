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
from rover_planner.planning.search.path_search import FOUND, NO_WAY
from rover_planner.viewer.state.background_work import Progress
from rover_planner.viewer.state.judging import (
    BETTER,
    PATH,
    POLICY,
    SEARCH,
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


BEGIN = [*[PATH] * 5, 5, *[POLICY] * 3, 5, SEARCH]
"""What is begun before and with a search, and how many candidates each result has."""


def judge(session: ViewSession) -> tuple[list, Shown]:
    """Judge all; return what is begun and how many candidates each result has, and the last."""
    steps = list(judge_request(JudgeRequest(session.wanted)))
    names = [
        one.what if isinstance(one, Progress) else len(one.answer.candidates) for one in steps
    ]
    return names, next(one for one in reversed(steps) if isinstance(one, Shown))


def test_beyond_a_wall_with_a_gap_a_way_follows_the_refused_candidates_and_is_shown():
    session = walled_session(wall_with_gap)
    assert session.plan_to(BEYOND)
    shown = session.shown
    *direct, way = shown.candidates
    assert len(direct) == 5 and not any(one.verdict.traversable for one in direct)
    assert shown.around.outcome == FOUND and shown.candidate is way
    assert shown.index == shown.answer.best == shown.answer.nearest == 5
    poses = way.poses
    np.testing.assert_allclose(poses[[0, -1], :2], [session.scenario.start[:2], BEYOND], atol=1e-9)
    assert np.all(poses[np.abs(poses[:, 0]) < 0.2, 1] > 1.0)
    assert judge_path(LSR1, session.terrain, poses)[1].traversable
    assert [one.policy for one in shown.by_policy] == list(TORQUE_POLICIES)
    assert not any(one.is_old for one in shown.by_policy)
    assert f"way of {shown.candidate.length:.1f} m around" in shown.summary


def test_the_first_way_is_shown_before_a_better_one_is_searched():
    way = [6, *[POLICY] * 3, 6]
    steps, _ = judge(walled_session(wall_with_gap, GOAL, ends_at_first=False))
    assert steps in ([*BEGIN, *way, BETTER], [*BEGIN, *way, BETTER, *way])


def test_where_there_is_no_way_the_reason_is_told():
    steps, shown = judge(walled_session(whole_wall, GOAL))
    assert steps == [*BEGIN, 5]
    assert shown.around.outcome == NO_WAY and len(shown.candidates) == 5
    assert not shown.verdict.traversable
    assert shown.reason.startswith("no way within the map: ") and "closed in by: " in shown.reason
    assert shown.reason.endswith(shown.verdict.reason)


def test_nothing_is_searched_where_a_candidate_passes_off_the_map_or_for_a_recorded_path():
    session = walled_session(wall_with_gap)
    for goal, passes in (((-1.1, 0.1), True), ((9.0, 0.0), False)):
        assert session.plan_to(np.array(goal))
        assert session.shown.around is None and session.shown.answer.traversable == passes
        assert SEARCH not in judge(session)[0]
    assert session.plan_to(np.array([-1.1, 0.1]))
    session.replay(session.shown.candidate.prediction, session.shown.verdict.reasons)
    assert session.change_rover(FRICTION, 0.05) and session.plan_again()
    assert not session.shown.verdict.traversable and session.shown.around is None


def test_a_slider_judges_the_shown_way_again_and_then_searches_another():
    session = walled_session(wall_with_gap)
    session.plan_to(BEYOND)
    poses, way = session.shown.candidate.poses, session.shown.around
    assert session.change_rover(FRICTION, 0.7)
    assert session.shown.index == 5 and session.shown.around is way
    np.testing.assert_array_equal(session.shown.candidate.poses, poses)
    assert session.plan_again()
    assert session.shown.index == 5 and session.shown.around is not way
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
    with held(session._background, SEARCH):
        assert session.plan_to(BEYOND)
        wait_until(lambda: session.progress.what == SEARCH, "the search", 60.0)
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
        assert session.is_stopped and session.shown is shown and session.shown.around is None
    assert session.plan_again()
    finish(session)
    assert session.shown.around.outcome == FOUND


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
    assert session.shown.needs_search and len(session.shown.candidates) == 5
    session.judge_in_background(lambda: None)
    try:
        finish(session)
        assert session.shown.index == 5 and session.shown.verdict.traversable
    finally:
        assert session.close()
