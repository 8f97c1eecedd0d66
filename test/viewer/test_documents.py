# SPDX-License-Identifier: Apache-2.0
"""What the page tells: limits along a path, the failure, the board, paths, and their words."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions
from rover_physics.names import EQUAL, OPTIMAL, SERVO, SIDES, WHEELS
from rover_physics.traversability.judge import judge_path
from rover_planner.viewer.documents import paths
from rover_planner.viewer.state.path_limits import Lane, find_failure, find_path_limits
from rover_planner.viewer.state.scenario import CANDIDATES, JudgedPath, Shown
from support.grounds import gap, wall_at, waves
from support.reference_drives import drive_ground, drive_path, unlimited
from support.viewer.sessions import LSR1, SURE, ramp, session_on


def stepped(x, y):
    """Return waves with an edge on which the model is asked between waypoints."""
    return waves(x, y) + 0.05 * (x > 0.3)


def judged_on(height, start=-1.0, **options) -> JudgedPath:
    """Return a straight path to x = 1 m over a ground, judged."""
    options = SURE.change(count=1, **options)
    return session_on(height, (start, 0.0, 0.0), (start + 2.0, 0.0, 0.0), options).shown.path


# Limits along a path.


def test_the_values_of_a_lane_are_those_of_the_prediction_at_its_waypoints():
    path = judged_on(waves)
    limits, prediction = path.limits, path.prediction
    at, torque = ~limits.rows.is_between, limits.lane("torque")
    np.testing.assert_allclose(limits.lane("belly").values[at], 100.0 * prediction.belly_clearance)
    assert (limits.lane("belly").bounds == 100.0 * LSR1.limits.belly_clearance).all()
    links = [limits.find_link(torque, row) for row in np.flatnonzero(at)]
    most_torque = prediction.torque_saturation.argmax(axis=1)
    np.testing.assert_array_equal(links, np.array(WHEELS)[most_torque])
    np.testing.assert_allclose(torque.wheels.max(axis=1), torque.used)


@pytest.mark.parametrize(
    ("height", "policy"),
    [(waves, EQUAL), (ramp, EQUAL), (ramp, SERVO), (stepped, OPTIMAL), (stepped, SERVO),
     (wall_at(0.5), EQUAL), (gap, EQUAL)],
)  # fmt: skip
def test_a_limit_is_broken_on_a_lane_exactly_where_the_verdict_refuses_the_path(height, policy):
    path = judged_on(height, policy=policy, friction=0.5)
    limits, failure, verdict = path.limits, path.failure, path.verdict
    broken = np.any([lane.used > 1.0 for lane in limits.lanes], axis=0)
    refused = set(np.unique(limits.rows.prediction.waypoint[broken]).tolist())
    first, by_limit = verdict.first_failure, verdict.code not in ("", "chance")
    assert refused == ({first} if by_limit else set())
    assert (failure is None) == verdict.traversable
    if failure is not None:
        assert failure.code == verdict.code and failure.headline
        assert np.isfinite(failure.state.position).all()
        stands = np.isfinite(failure.state.wheel_loads).all()
        assert stands == (failure.code != "unknown_ground")


@pytest.mark.parametrize(
    ("height", "policy", "is_between"),
    [(ramp, EQUAL, False), (ramp, OPTIMAL, True), (stepped, EQUAL, True)],
)
def test_board_lanes_curves_and_verdict_show_one_number_for_the_wheel_that_fails(
    height, policy, is_between
):
    path = judged_on(height, friction=0.3, policy=policy)
    failure, end = path.failure, path.trajectory.times[-1]
    assert failure.code == "friction" and failure.link in WHEELS
    use = float(path.limits.lane("friction").used[failure.row])
    words = path.limits.lane("friction").compare(failure.row)
    assert failure.headline == f"{words}, {failure.link.replace('_', ' ')} wheel"
    told = words.replace("friction", "utilisation").replace(" of ", ", limit ")
    [reason] = paths.describe_verdict(Shown(path.scenario, (path,), 0, 1))["details"]
    assert failure.is_between == reason.startswith("at the next waypoint: ") == is_between
    assert failure.link in reason and (told in reason or is_between)
    wheel, codes = WHEELS.index(failure.link), [lane.code for lane in path.limits.lanes]
    board = paths.describe_board(failure.state, failure.link)["wheels"][wheel]
    assert board["fails"] and board["bars"][0][2] == paths.write_use(use)
    used = paths.describe_uses(path, end)[codes.index("friction")]
    assert used["now"] == used["worst"] == paths.write_use(use) and used["broken"]
    assert used["link"] == failure.link.replace("_", " ") and used["link"] in failure.headline
    lane = paths.describe_limits(path, None)["lanes"][codes.index("friction")]
    assert max(lane["wheels"]["y"][wheel]) == pytest.approx(use, abs=1e-3)
    assert max(lane["now"]["y"][0]) == pytest.approx(use, abs=1e-3)
    [row] = paths.describe_paths(Shown(path.scenario, (path,), 0, 1))["rows"]
    assert row["use"] == paths.write_use(use) and row["reason"] == path.verdict.reason


def test_the_worst_so_far_grows_and_has_all_limits_in_one_unit():
    path = judged_on(waves)
    worst = [
        [one["worst"].removesuffix(" %") for one in paths.describe_uses(path, time)]
        for time in np.linspace(0.0, path.trajectory.times[-1], 5)[1:]
    ]
    assert (np.diff(np.array(worst, float), axis=0) >= 0.0).all()


def test_the_chance_of_failure_is_a_lane_of_its_own_with_its_main_cause():
    session = session_on(ramp, options=CANDIDATES)
    session.change_rover([("friction",)], 0.55)
    shown = session.shown
    asked = shown.scenario
    _, verdict = judge_path(asked.rover, asked.terrain, shown.path.poses, accepted_chance=1.0)
    assert 0.0 < verdict.failure_chance < 1.0
    assert shown.chance.path == verdict.failure_chance
    told = paths.describe_limits(shown.path, None, shown.chance)["lanes"]
    assert [lane["code"] for lane in told].index("chance") == len(shown.path.limits.lanes)
    curve = told[-1]["now"]["y"][0]
    end = 1 + int(shown.path.limits.rows.prediction.waypoint[-1])
    assert max(curve) == pytest.approx(max(verdict.failure_chance_at[:end]), abs=1e-3)
    use = paths.describe_uses(shown.path, np.inf, shown.chance)[-1]
    assert use["broken"]
    percent = f"{100.0 * verdict.failure_chance:.0f} %"
    assert use["value"] == f"whole path {percent}"
    words = paths.describe_verdict(shown)
    assert words["chance"] == f"chance of failure {percent}, most often by friction"
    assert words["headline"] == "chance of failure above what is accepted"
    assert paths.describe_limits(shown.path, None, shown.chance)["code"] == "chance"


def test_the_chance_of_a_path_that_is_refused_is_that_up_to_its_failure():
    session = session_on(wall_at(0.5), options=CANDIDATES)
    session.ask()
    shown = session.shown
    assert len(shown.chance.at) == shown.verdict.first_failure + 1 < len(shown.path.poses)
    told = paths.describe_uses(shown.path, np.inf, shown.chance)[-1]
    assert told["value"] == f"up to the failure {100.0 * shown.chance.path:.0f} %"


def test_a_peak_between_points_of_a_curve_is_kept():
    values = np.zeros((10 * paths.MAX_POINTS, 2))
    values[1237, 1] = 5.0
    rows = paths.choose_rows(values)
    assert len(rows) <= paths.MAX_POINTS + 2 and values[rows].max() == 5.0


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1.234, "friction 1.23 of 1.00"),
        (1.0004, "friction 1.0004 of 1.0000"),
        (1.00004, "friction just above 1.00"),
        (np.inf, "friction far above 1.00"),
        (0.99999, "friction just below 1.00"),
    ],
)
def test_as_many_digits_as_tell_a_value_from_its_limit_and_words_where_none_do(value, words):
    values, bounds = np.array([value]), np.ones(1)
    assert Lane("friction", "friction", values, values, bounds).compare(0) == words


def test_a_use_that_is_above_the_limit_never_reads_as_one_at_it():
    assert [paths.write_use(use) for use in (0.996, 1.0, 1.0001, 1.23)] == [
        "100 %", "100 %", "just above 100 %", "123 %",
    ]  # fmt: skip
    assert (paths.write_use(np.nan), paths.write_use(np.inf)) == ("not asked", "fails")


def test_with_speed_servos_friction_is_no_number_that_a_passing_path_may_cross():
    for policy, bound in ((EQUAL, LSR1.limits.friction_utilisation), (SERVO, None)):
        bounds = judged_on(ramp, policy=policy).limits.lane("friction").bounds
        assert bounds is None if bound is None else (bounds == bound).all()


# The failure.


def test_a_wedged_wheel_has_no_number_beside_the_limit_of_friction():
    rover, ground = unlimited(LSR1), drive_ground("ditch", 0.194)
    options = SweepOptions(OPTIMAL, friction=0.86, max_torque=2.44)
    prediction, verdict = judge_path(rover, ground, drive_path(), options)
    limits = find_path_limits(rover, prediction, verdict)
    failure = find_failure(rover, ground, verdict, limits)
    assert "wedged" in failure.headline
    assert not limits.lane("friction").write_value(failure.row)


def test_a_failure_between_waypoints_has_the_pose_at_which_the_model_was_asked():
    path = judged_on(stepped, friction=0.4)
    failure, prediction, rows = path.failure, path.prediction, path.limits.rows
    assert (np.diff(rows.distance) >= 0.0).all() and (np.diff(rows.time) >= 0.0).all()
    assert failure is not None and failure.is_between
    first = path.verdict.first_failure
    before, after = prediction.distance[first - 1 : first + 1]
    assert before < failure.state.distance < after
    assert 0.0 < prediction.energy[first - 1] < failure.state.energy
    there = path.trajectory.state_at(failure.state.time)
    np.testing.assert_allclose(there.wheel_loads, failure.state.wheel_loads)
    places = prediction.between.position[prediction.between.waypoint == first]
    assert np.isclose(places, failure.state.position).all(axis=1).any()
    # Of two states at one place, as where a wheel rolls off an edge, the one that fails is shown.
    between = prediction.between
    again = between.select([*range(len(between.poses)), 0])
    poses = np.vstack([between.poses, failure.state.here.poses])
    waypoints = np.append(between.waypoint, first)
    again = replace(again, poses=poses, waypoint=waypoints)
    twin = replace(path, prediction=replace(prediction, between=again))
    assert twin.failure.headline == failure.headline
    shown = twin.state_at(failure.state.time)
    np.testing.assert_array_equal(shown.wheel_loads, failure.state.wheel_loads)
    assert twin.state_at(failure.state.time - 1.0).time < failure.state.time


def test_where_the_rover_does_not_settle_a_level_one_stands_and_the_wheel_beyond_is_named():
    path = judged_on(gap)
    failure, (ground, *_) = path.failure, paths.describe_limits(path, None)["lanes"]
    assert failure is not None and failure.code == "unknown_ground"
    assert (ground["code"], ground["now"]["y"][0][-1]) == ("ground", paths.MAX_USE)
    assert np.isnan(failure.state.wheel_loads).all() and failure.link.startswith("front")
    assert failure.headline.startswith("unknown ground, front")
    np.testing.assert_allclose(failure.state.attitude[:2], 0.0)
    level = judged_on(lambda x, y: 0.0 * x).trajectory.state_at(0.0)
    away, right = (one.wheel_centres - one.position for one in (failure.state, level))
    np.testing.assert_allclose(np.abs(away), np.abs(right), atol=0.01)


def test_the_joint_that_ends_a_path_is_named_by_its_failure_and_by_the_uses():
    rover = replace(LSR1, suspension=replace(LSR1.suspension, bogie_limits=(-0.01, 0.01)))
    path = session_on(waves, options=SURE.change(count=1), rover=rover).shown.path
    failure = path.failure
    turned = np.abs(failure.state.here.bogie_angle[0])
    assert failure.code == "suspension" and turned.max() > 0.01
    assert failure.link == f"bogie_{SIDES[int(turned.argmax())]}"
    joints = [lane.code for lane in path.limits.lanes].index("suspension")
    assert paths.describe_uses(path, np.inf)[joints]["link"] == failure.link.replace("_", " ")


@pytest.mark.parametrize("start", [-1.0, 0.4])
def test_a_refusal_on_unknown_ground_is_at_the_time_to_which_the_drive_is_played(start):
    shown = session_on(gap, start=(start, 0.0, 0.0), goal=(1.9, 0.0, 0.0)).shown
    path = shown.path
    assert path.failure is not None and path.failure.code == "unknown_ground"
    assert path.failure.state.time == path.trajectory.times[-1]
    assert (path.trajectory.length == 0) == (start > 0.0) == (path.failure.state.time == 0.0)
    assert (path.trajectory.state_at(0.0) is None) == (start > 0.0)
    told = [paths.describe_verdict(shown), paths.describe_paths(shown)["rows"]]
    told += [paths.describe_limits(path, None), paths.describe_uses(path, 0.0)]
    json.dumps(told, allow_nan=False)


# The board, paths, sliders.


def test_the_board_has_all_loads_and_unknown_values_are_none_or_a_question_mark():
    path = judged_on(waves)
    state = path.trajectory.state_at(20.0)
    board = paths.describe_board(state)
    assert [one["load"] for one in board["wheels"]] == [
        f"{load:.1f} N" for load in state.wheel_loads
    ]
    assert [len(cells) for _, cells in board["table"]] == [6] * 6
    lost = {"wheel_loads": np.full(6, np.nan), "friction_utilisation": np.full(6, np.nan)}
    unknown = replace(state, here=state.here.change(**lost))
    board = paths.describe_board(unknown)
    assert {one["load"] for one in board["wheels"]} == {"?"}
    assert {one["bars"][0][1] for one in board["wheels"]} == {None}
    json.dumps(board, allow_nan=False)


def test_each_number_of_the_rover_has_a_slider_and_what_it_changes_of_the_drive_is_listed():
    session = session_on(ramp)
    sliders = paths.describe_sliders(session.wanted)
    labels = [one[0] for part in sliders for one in part["sliders"]]
    assert labels == list(paths.read_values(session.wanted))
    before = session.shown.path
    session.change_rover([("friction",)], 0.4)
    after = session.shown.path
    rows = {name: (was, now) for name, was, now in paths.compare_drives(before, after)}
    assert rows["verdict"] == ("passes", "refused") and "driven" in rows
    used = [float(np.nanmax(one.limits.lane("friction").used)) for one in (before, after)]
    assert rows["friction"] == tuple(map(paths.write_use, used))
    lanes = {lane["code"]: lane for lane in paths.describe_limits(after, before)["lanes"]}
    now, then = (max(lanes["friction"][when]["y"][0]) for when in ("now", "before"))
    assert now > 1.0 > then > 0.0
