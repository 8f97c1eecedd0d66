# SPDX-License-Identifier: Apache-2.0
"""Why and where a path is refused: limits along it, the failure, candidates, before and after."""

import numpy as np
import pytest

from rover_physics.names import EQUAL, OPTIMAL, SERVO, WHEELS
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.viewer.state.before_after import (
    ChangeHistory,
    compare_drives,
    list_changes,
)
from rover_planner.viewer.state.candidate_rows import list_candidates, place_numbers
from rover_planner.viewer.state.failure import explain
from rover_planner.viewer.state.path_limits import find_worst
from rover_planner.viewer.state.session import ViewSession
from support.grounds import gap, make_terrain, wall_at, waves
from support.viewer.sessions import LSR1, ramp, session_on


def stepped(x, y):
    """Return waves with a low step up, which wheels climb between waypoints."""
    return waves(x, y) + 0.05 * (x > 0.3)


def why_on(height, **options):
    """Return prediction, verdict and explanation of a straight path of 2 m over a ground."""
    options = PathQueryOptions(count=1).change(**options)
    ends = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    session = ViewSession(LSR1, make_terrain(height), *ends, options)
    shown = session.shown
    return shown.candidate.prediction, shown.verdict, explain(session.shown)


# Limits along a path.


def test_the_values_of_a_lane_are_those_of_the_prediction_at_its_waypoints():
    prediction, _, why = why_on(waves)
    limits, at = why.limits, ~why.limits.rows.is_between
    np.testing.assert_array_equal(
        limits.lane("friction").values[at], prediction.friction_utilisation.max(axis=1)
    )
    np.testing.assert_allclose(limits.lane("belly").values[at], 100.0 * prediction.belly_clearance)
    wheels = limits.lane("torque").wheel[at]
    np.testing.assert_array_equal(wheels, prediction.torque_saturation.argmax(axis=1))


def test_rows_are_in_the_order_of_the_path_with_the_poses_between_in_their_places():
    _, _, why = why_on(stepped)
    rows = why.limits.rows
    assert rows.is_between.any()
    assert (np.diff(rows.distance) >= 0.0).all() and (np.diff(rows.time) >= 0.0).all()


@pytest.mark.parametrize(
    ("height", "policy"),
    [(waves, EQUAL), (ramp, EQUAL), (ramp, SERVO), (stepped, OPTIMAL), (stepped, SERVO),
     (wall_at(0.5), EQUAL), (gap, EQUAL)],
)  # fmt: skip
def test_a_limit_is_broken_on_a_lane_exactly_where_the_verdict_refuses_the_path(height, policy):
    _, verdict, why = why_on(height, policy=policy, friction=0.5)
    limits, failure = why.limits, why.failure
    broken = np.any([lane.used > 1.0 for lane in limits.lanes], axis=0)
    refused = set(np.unique(limits.rows.prediction.waypoint[broken]).tolist())
    first = verdict.first_failure
    assert refused == ({first} if first >= 0 else set())
    assert (failure is None) == verdict.traversable
    if failure is not None:
        assert failure.code == verdict.code and failure.headline
        assert np.isfinite(failure.state.position).all()
        assert failure.is_settled == (failure.code != "unknown_ground")


def test_the_worst_so_far_grows_and_ends_with_the_extremes_of_the_verdict():
    prediction, verdict, why = why_on(waves)
    times = np.linspace(0.0, prediction.time[-1], 7)
    used = np.array([[one.used for one in find_worst(why.limits, time)] for time in times])
    assert (np.diff(used, axis=0) >= 0.0).all()
    last = {one.title: one for one in find_worst(why.limits, prediction.time[-1])}
    assert last["friction"].value == f"{verdict.max_friction_utilisation:.2f}"
    assert last["margin"].value == f"{verdict.min_tip_over_ratio:.2f}"
    assert last["tilt"].value == f"{np.degrees(verdict.max_tilt):.1f}"


def test_with_speed_servos_friction_is_no_number_that_a_passing_path_may_cross():
    for policy, bound in ((EQUAL, LSR1.limits.friction_utilisation), (SERVO, None)):
        assert why_on(ramp, policy=policy)[2].limits.lane("friction").limit.bound == bound


# The failure.


def test_the_failure_names_value_limit_and_wheel_as_the_verdict_does():
    prediction, verdict, why = why_on(ramp, friction=0.3)
    failure = why.failure
    assert failure is not None and failure.code == verdict.code == "friction"
    assert failure.link in WHEELS and failure.link in verdict.reason
    assert f"{failure.value:.2f}, limit 1.00" in verdict.reason
    assert failure.headline == f"friction {failure.value:.2f} of 1.00, {failure.where}"
    row = verdict.first_failure
    assert failure.distance == pytest.approx(prediction.distance[row], abs=0.021)
    assert why.failure_at == failure.distance
    assert why.limits.end >= failure.distance


def test_a_failure_between_waypoints_has_the_pose_at_which_the_model_was_asked():
    prediction, verdict, why = why_on(stepped, friction=0.4)
    failure = why.failure
    assert failure is not None and failure.is_between
    assert verdict.reason.startswith("on the way here")
    first = verdict.first_failure
    before, after = prediction.distance[first - 1 : first + 1]
    assert before < failure.distance < after
    places = prediction.between.position[prediction.between.waypoint == first]
    assert np.isclose(places, failure.state.position).all(axis=1).any()


def test_where_the_rover_does_not_settle_a_level_one_stands_and_the_wheel_beyond_is_named():
    failure = why_on(gap)[2].failure
    assert failure is not None and failure.code == "unknown_ground"
    assert not failure.is_settled and failure.link.startswith("front")
    assert failure.headline.startswith("unknown ground, front")
    np.testing.assert_allclose(failure.state.attitude[:2], 0.0)
    wheels = failure.state.wheel_centres - failure.state.position
    prediction, _, _ = why_on(lambda x, y: 0.0 * x)
    right = prediction.wheel_centres[0] - prediction.position[0]
    np.testing.assert_allclose(np.abs(wheels), np.abs(right), atol=0.01)


@pytest.mark.parametrize("start", [-1.0, 0.4])
def test_a_refusal_on_unknown_ground_is_at_the_time_to_which_the_drive_is_played(start):
    session = session_on(gap, start=(start, 0.0, 0.0), goal=(1.9, 0.0, 0.0))
    shown, why = session.shown, explain(session.shown)
    assert why.failure is not None and why.failure.code == "unknown_ground"
    assert why.failure.time == shown.trajectory.duration
    assert (shown.trajectory.length == 0) == (start > 0.0) == (why.failure.time == 0.0)
    assert np.isfinite(why.limits.rows.time).all()
    for row in list_candidates(session.shown, False):
        assert np.isfinite(row.energy)


# Candidates.


def test_a_row_of_a_candidate_has_the_numbers_of_its_verdict():
    session = session_on(wall_at(0.5), goal=(1.5, 0.0, 0.0))
    rows = list_candidates(session.shown, True)
    for row, candidate in zip(rows, session.shown.candidates, strict=True):
        assert row.verdict is candidate.verdict
        assert row.driven < candidate.length or row.verdict.traversable
    assert [row.number for row in rows if row.is_best] == [session.shown.answer.nearest + 1]
    assert [row.number for row in rows if not row.is_old] == [session.shown.index + 1]


@pytest.mark.parametrize("replayed", [False, True])
def test_the_numbers_of_the_only_path_are_those_up_to_its_failure(replayed):
    session = session_on(gap, start=(-1.5, 0.0, 0.0), goal=(2.5, 0.0, 0.0))
    poses = session.shown.candidates[0].poses

    def slope_beyond(x, y):
        return gap(x, y) + 0.5 * np.maximum(x - 1.0, 0.0)

    prediction, verdict = judge_path(LSR1, make_terrain(slope_beyond), poses)
    assert verdict.max_tilt > 0.4
    session = ViewSession(
        LSR1,
        make_terrain(slope_beyond),
        session.scenario.start,
        session.scenario.goal,
        PathQueryOptions(count=1),
    )
    if replayed:
        session.replay(prediction, verdict.reasons)
    [candidate] = session.shown.candidates
    assert candidate.verdict.code == "unknown_ground"
    before = prediction.cut(verdict.first_failure + 1)
    assert candidate.verdict.max_tilt == hold_against_limits(LSR1, before).max_tilt < 0.2


def test_the_numbers_of_paths_stand_on_them_and_apart_from_each_other():
    session = session_on(waves)
    paths = [candidate.poses[:, :2] for candidate in session.shown.candidates]
    taken = np.array([session.scenario.start[:2], session.scenario.goal[:2]])
    places = place_numbers(paths, taken)
    for path, place in zip(paths, places, strict=True):
        assert np.linalg.norm(path - place, axis=1).min() < 0.03
    both = np.concatenate([places, taken])
    away = np.linalg.norm(both[:, None] - both[None], axis=2)
    assert away[~np.eye(len(both), dtype=bool)].min() > 0.4


# Before and after.


def changed(session, friction: float) -> None:
    session.change_rover([("friction",)], friction)


def test_the_rover_before_is_the_last_one_for_which_all_paths_were_judged():
    session = session_on(waves)
    history = ChangeHistory(session.shown)
    first = session.shown
    for friction in (0.7, 0.65, 0.6):  # a slider that is dragged
        changed(session, friction)
        history.take(session.shown)
        assert history.reference_for(session.shown) is first
    session.plan_again()
    history.take(session.shown)
    assert history.reference_for(session.shown).scenario.rover.friction == 0.8
    changed(session, 0.5)
    history.take(session.shown)
    assert history.reference_for(session.shown).scenario.rover.friction == 0.6


def test_undo_goes_back_rover_by_rover():
    session = session_on(waves)
    history = ChangeHistory(session.shown)
    for friction in (0.7, 0.6):
        changed(session, friction)
        session.plan_again()
        history.take(session.shown)
    for friction in (0.7, 0.8):
        back = history.undo(session.wanted).scenario
        assert back.rover.friction == friction
        session.restore_rover(back.rover, back.arm_angles)
        history.take(session.shown)
    assert history.undo(session.wanted) is None


def test_undo_takes_back_a_change_before_all_its_paths_are_judged():
    session = session_on(waves)
    history = ChangeHistory(session.shown)
    changed(session, 0.7)  # only the shown path is judged
    assert history.undo(session.wanted).scenario.rover.friction == 0.8
    session.plan_again()
    history.take(session.shown)
    changed(session, 0.6)
    assert history.undo(session.wanted).scenario.rover.friction == 0.7


def test_undo_never_brings_numbers_of_one_rover_to_another_that_was_loaded_since():
    session = session_on(waves)
    history = ChangeHistory(session.shown)
    changed(session, 0.7)
    session.plan_again()
    history.take(session.shown)
    session.take_rover(load_rover("m2020"))  # and not taken by the history yet
    assert history.undo(session.wanted) is None


def test_another_goal_begins_the_history_anew():
    session = session_on(waves)
    history = ChangeHistory(session.shown)
    changed(session, 0.7)
    session.plan_again()
    history.take(session.shown)
    session.plan_to(np.array([0.5, 0.5]))
    history.take(session.shown)
    assert history.reference_for(session.shown) is None


def test_changed_numbers_and_differences_of_the_drive_are_those_of_the_rovers():
    session = session_on(ramp)
    before = session.shown.trajectory
    changed(session, 0.4)
    assert list_changes(session.wanted.loaded, session.rover) == {"friction [-]": (0.8, 0.4)}
    found = {one.name: one for one in compare_drives(before, session.shown.trajectory)}
    friction = found["friction, largest"]
    assert friction.before == before.verdict.max_friction_utilisation
    assert friction.after == session.shown.verdict.max_friction_utilisation
    assert found["driven"].change < 0.0
