# SPDX-License-Identifier: Apache-2.0
"""Ways around obstacles, without a browser: searched, offered, looked at, cancelled, explained."""

import numpy as np

from rover_planner.planning.search.path_search import FOUND, NO_WAY
from rover_planner.planning.search.query import LatticeSettings
from rover_planner.viewer.documents.paths import describe_verdict
from rover_planner.viewer.state.background_work import WorkStep
from rover_planner.viewer.state.judging import BETTER, SEARCH, judge_steps
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, wall_with_gap, waves
from support.viewer.sessions import Judge, held, session_on
from support.waiting import wait_until

GOAL = (1.6, 0.0, 0.0)
"""A pose on the other side of the wall."""
BEYOND = np.array(GOAL[:2])
"""Its place [m]."""
FRICTION = [("friction",)]


def walled_session(height, goal=(-1.1, 0.0, 0.0), *, ends_at_first=True):
    """Return a session on 5 m x 5 m with a wall at x = 0; a search for the best may take long."""
    search = LatticeSettings(budget=60.0, ends_at_first=ends_at_first)
    ground = make_terrain(height, half=2.5)
    return session_on(ground, (-1.6, 0.0, 0.0), goal, search=search)


def list_steps(session: ViewSession) -> list[str | int]:
    """Return what is begun, and how many paths each result has, when all is judged."""
    steps = judge_steps(session.wanted)
    return [one.what if isinstance(one, WorkStep) else len(one.paths) for one in steps]


def test_beyond_a_wall_with_a_gap_a_path_around_is_offered_and_what_is_looked_at_stays():
    session = walled_session(wall_with_gap)
    session.plan_to(BEYOND)
    shown = session.shown
    *direct, around = shown.paths
    assert len(direct) == 5 and not any(one.verdict.traversable for one in direct)
    assert shown.around.outcome == FOUND and shown.path is not around and shown.offer == 5
    [offer] = describe_verdict(shown)["offers"]
    assert offer["words"].startswith("path 6 goes around and passes")
    ends = shown.scenario.start[:2], BEYOND
    np.testing.assert_allclose(around.poses[[0, -1], :2], ends, atol=1e-9)
    session.show_path(5)
    for friction in (0.7, 0.75):
        session.change_rover(FRICTION, friction)
        assert session.shown.index == 5 and len(session.shown.paths) == 6
        np.testing.assert_array_equal(session.shown.path.poses, around.poses)
    session.show_path(0)
    session.change_rover(FRICTION, 0.72)
    assert session.shown.index == 0 and session.shown.around is not shown.around


def test_the_first_path_around_is_shown_before_a_better_one_is_searched():
    steps = list_steps(walled_session(wall_with_gap, GOAL, ends_at_first=False))
    after = steps[steps.index(SEARCH) + 1 :]
    assert after in ([6, BETTER], [6, BETTER, 6])


def test_where_there_is_no_path_the_reason_is_told():
    session = walled_session(lambda x, y: waves(x, y) + 0.5 * (np.abs(x) < 0.2), GOAL)
    session.ask()
    shown = session.shown
    assert shown.around.outcome == NO_WAY and len(shown.paths) == 5
    details = describe_verdict(shown)["details"]
    assert details[0] == shown.verdict.reason
    assert details[1].startswith("no path within the map: ") and "closed in" in details[1]


def test_nothing_is_searched_where_a_candidate_passes_off_the_map_or_for_a_recorded_path():
    session = walled_session(wall_with_gap)
    for goal, passes in (((-1.1, 0.1), True), ((9.0, 0.0), False)):
        session.plan_to(np.array(goal))
        assert session.shown.around is None and session.shown.verdict.traversable == passes
        assert SEARCH not in list_steps(session)
    session.plan_to(np.array([-1.1, 0.1]))
    session.replay(session.shown.path.prediction, session.shown.verdict.reasons)
    session.change_rover(FRICTION, 0.05)
    assert not session.shown.verdict.traversable and session.shown.around is None


def test_a_search_can_be_cancelled_and_begun_again_and_a_chosen_path_stays_meanwhile():
    session = walled_session(wall_with_gap)
    with Judge(session) as judge:
        work = judge.work
        with held(session, SEARCH):
            session.plan_to(BEYOND)
            wait_until(lambda: work.progress.what == SEARCH, "the search", 60.0)
            judge.take()
            assert not session.is_outdated and not session.shown.verdict.traversable
            other = 1 if session.shown.index != 1 else 2
            session.show_path(other)
            wait_until(lambda: work.progress.what == SEARCH, "the search again", 60.0)
            judge.take()
            shown = session.shown
            work.cancel()
            judge.take()
            assert session.shown is shown and shown.around is None
        session.ask()
        judge.finish()
        assert session.shown.around.outcome == FOUND and session.shown.index == other
