# SPDX-License-Identifier: Apache-2.0
"""Motions along a path: arcs are arcs however sampled, long turns are judged all along."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_physics import PoseStatus, SweepOptions, Terrain, judge_path, judge_poses
from rover_physics.errors import PoseError
from rover_physics.names import TORQUE_POLICIES
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.traversability.judge import PartwiseJudge
from support.grounds import make_terrain, plane, random_poses
from support.paths import arc_of, poses_at
from support.rovers import ALL_STEER, FIXED, LSR1, M2020

LEVEL = Terrain(np.zeros((401, 401)), 0.02, (-4.0, -4.0))
SPEED = LSR1.nominal_speed


def motions(poses, rover=LSR1, backward=False, curvature=None):
    model = pack_model(rover, LEVEL, SweepOptions(backward=backward))
    return motions_of(model, np.array(poses, float), curvature)


def straight(count=20, spacing=0.05, yaw=0.7):
    return arc_of(0.0, spacing * np.arange(count), yaw)


def arc(curvature, spacing=0.05, length=1.5, yaw=0.3):
    return arc_of(curvature, np.arange(0.0, length, spacing), yaw)


def spot(turn=2.0 * np.pi, count=37):
    return poses_at(0.0, 0.0, np.linspace(0.0, turn, count))


@given(st.floats(-3.1, 3.1), st.booleans())
def test_a_straight_path_is_exactly_straight(yaw, backward):
    poses = straight(yaw=yaw)[:: -1 if backward else 1]
    speed = -SPEED if backward else SPEED
    assert motions(poses, backward=backward).tolist() == [[speed, 0.0, 0.0]] * 20
    prediction = judge_path(LSR1, LEVEL, poses[5:15], SweepOptions(backward=backward))[0]
    assert (prediction.steering_angle == 0.0).all()
    assert prediction.wheel_speed == pytest.approx(np.full((10, 6), speed / 0.1))


@given(st.floats(0.2, 1.5), st.sampled_from([0.02, 0.05, 0.1, 0.3]), st.sampled_from([1.0, -1.0]))
def test_an_arc_has_its_curvature_whatever_its_sampling(curvature, spacing, side):
    found = motions(arc(side * curvature, spacing))
    assert found[:, 0] == pytest.approx(np.full(len(found), SPEED))
    assert (found[:, 1] == 0.0).all()
    assert found[:, 2] == pytest.approx(np.full(len(found), side * curvature * SPEED))


@given(st.floats(0.2, 1.5), st.sampled_from([0.05, 0.1, 0.3]))
def test_an_arc_whose_headings_follow_its_chords_is_an_arc(curvature, spacing):
    x, y, _ = arc(curvature, spacing).T
    ahead = np.arctan2(np.diff(y), np.diff(x))
    found = motions(poses_at(x, y, np.append(ahead, ahead[-1])))
    assert (found[:, 1] == 0.0).all()
    assert found[1:-1, 2] == pytest.approx(np.full(len(found) - 2, curvature * SPEED), rel=0.02)


def test_the_same_place_with_other_headings_is_a_turn_on_the_spot():
    found = motions(spot())
    assert (found[:, :2] == 0.0).all()
    fastest = SPEED / np.hypot(0.40, 0.31)
    assert found[:, 2] == pytest.approx(np.full(37, fastest))
    assert motions(spot(-2.0))[:, 2] == pytest.approx(np.full(37, -fastest))
    prediction = judge_path(LSR1, LEVEL, spot())[0]
    assert prediction.time[-1] == pytest.approx(2.0 * np.pi / fastest)
    assert prediction.distance[-1] == 0.0


def test_repeated_waypoints_keep_the_motion_before_them():
    poses = np.repeat(arc(0.8), 2, axis=0)
    assert motions(poses)[1::2] == pytest.approx(motions(arc(0.8)))
    assert motions(np.zeros((3, 3))).tolist() == [[SPEED, 0.0, 0.0]] * 3


def test_a_sideways_path_is_a_crab_and_refused_by_wheel_and_angle_where_some_wheels_are_fixed():
    poses = poses_at(0.05 * np.arange(20), yaw=-0.5)
    expected = SPEED * np.array([np.cos(0.5), np.sin(0.5), 0.0])
    assert motions(poses, ALL_STEER) == pytest.approx(np.tile(expected, (20, 1)), abs=1e-15)
    prediction, verdict = judge_path(ALL_STEER, LEVEL, poses)
    assert verdict.traversable
    assert prediction.steering_angle == pytest.approx(np.full((20, 6), 0.5))
    prediction, verdict = judge_path(LSR1, LEVEL, poses)
    assert verdict.code == "steering" and verdict.first_failure == 0
    assert verdict.reason.startswith("middle_right wheel does not steer: ")
    assert "28.6 deg aside of its heading" in verdict.reason
    assert (prediction.status == PoseStatus.STEERING).all() and not prediction.settled.any()
    assert np.isnan(prediction.wheel_loads).all() and np.isnan(prediction.wheel_speed).all()
    assert judge_path(FIXED, LEVEL, poses)[1].traversable


def test_a_curve_tighter_than_the_limit_is_refused_by_wheel_and_angle():
    stiff = replace(LSR1, steering=replace(LSR1.steering, limit=0.4))
    path = np.vstack([straight(10, yaw=0.0), arc(1.0, yaw=0.0)[1:] + poses_at(0.45)])
    _, verdict = judge_path(stiff, LEVEL, path)
    assert (verdict.code, verdict.first_failure) == ("steering", 10)
    words = "rear_left wheel needs a steering angle of -30.1 deg, limit 22.9 deg"
    assert verdict.reason == words
    assert judge_path(stiff, LEVEL, arc(0.5))[1].traversable


def test_the_swing_of_the_middle_axle_of_m2020_is_no_crab():
    """Driven so that the fixed middle wheels, behind the origin, do not skid."""
    turn = 0.6 * np.arange(0.0, 3.0, 0.2)
    ahead = 0.304 * poses_at(np.cos(turn), np.sin(turn))
    found = motions(arc_of(0.6, turn / 0.6) + ahead, M2020)
    assert (found[:, 1] == 0.0).all() and (found[:, 2] > 0.0).all()


def test_poses_that_form_no_path_have_their_wheels_ahead():
    for seed in range(10):
        found = motions(random_poses(seed, 40, 0.5))
        assert found.tolist() == [[SPEED, 0.0, 0.0]] * 40


def test_a_long_step_leaves_the_way_open():
    poses = np.vstack([arc(1.0), arc(1.0) + poses_at(5.0)])
    found = motions(poses)
    assert found[len(arc(1.0))].tolist() == [SPEED, 0.0, 0.0]
    assert np.delete(found[:, 2], len(arc(1.0))) == pytest.approx(SPEED)


def test_no_wheel_is_faster_than_its_drive():
    fast = replace(LSR1, nominal_speed=0.1)
    found = motions(arc(1.5), fast)
    prediction = judge_path(fast, LEVEL, arc(1.5))[0]
    assert found[0, 0] < 0.1 and found[0, 2] == pytest.approx(1.5 * found[0, 0])
    assert np.abs(prediction.wheel_speed).max() == pytest.approx(LSR1.wheel.max_speed)


@given(st.floats(-3.0, 3.0))
def test_a_given_curvature_is_the_one_of_the_arc(curvature):
    found = motions([[0.0, 0.0, 0.3]], curvature=[curvature])[0]
    assert found[2] == pytest.approx(curvature * found[0], abs=1e-7)
    left, right = motions(np.zeros((2, 3)), curvature=[np.inf, -np.inf])
    assert left.tolist() == (-right).tolist() and left[2] > 0.0 and left[0] == 0.0


@pytest.mark.parametrize(
    ("curvature", "what"),
    [
        ([0.0, np.nan, 0.0], "curvature of pose 1 is nan"),
        ([0.0, 0.0], r"shape \(2,\); it must be \(3,\)"),
        (["a", "b", "c"], "curvature is not numbers"),
    ],
)
def test_curvatures_that_are_none_are_refused(curvature, what):
    with pytest.raises(PoseError, match=what):
        judge_poses(LSR1, LEVEL, np.zeros((3, 3)), curvature)[0]


def test_the_drive_waits_for_wheels_that_turn():
    path = np.vstack([straight(11, yaw=0.0), spot(np.pi, 19)[1:] + poses_at(0.5)])
    prediction = judge_path(LSR1, LEVEL, path)[0]
    turning = np.arctan2(0.40, 0.31) / 0.35
    step = np.pi / 18.0 * np.hypot(0.40, 0.31) / SPEED
    assert np.diff(prediction.time)[10] == pytest.approx(max(turning, step))
    quick = replace(LSR1, steering=replace(LSR1.steering, rate=0.01))
    slow = judge_path(quick, LEVEL, path)[0]
    assert np.diff(slow.time)[10] == pytest.approx(np.arctan2(0.40, 0.31) / 0.01)
    assert slow.energy == pytest.approx(prediction.energy)


def test_wheels_that_turn_beside_a_wall_are_judged_whole_and_split_alike():
    """The straight wheels pass the wall at 2 cm, the turned ones would be in it."""
    wall = make_terrain(lambda x, y: 0.5 * np.clip((y - 0.37) / 0.02, 0.0, 1.0), 0.02, 3.0)
    path = np.vstack([straight(11, yaw=0.0), spot(0.3, 10)[1:] + poses_at(0.5)])
    whole = judge_path(LSR1, wall, path)[1]
    before, after = (judge_path(LSR1, wall, part)[1] for part in (path[:11], path[10:]))
    assert before.traversable and not after.traversable and after.first_failure == 0
    assert (whole.first_failure, whole.code) == (11, after.code)


def test_power_is_what_each_wheel_spends_on_its_own_way():
    ground, sand = plane(0.05, 0.0), SweepOptions(soil="dry_sand")
    prediction = judge_path(LSR1, ground, arc(1.0, length=0.6), sand)[0]
    speed = prediction.wheel_speed / (1.0 - prediction.slip_ratio)
    spent = np.maximum(prediction.torque * speed, 0.0).sum(axis=1)
    assert prediction.power == pytest.approx(spent)


HALF_TURN, DENSE = spot(np.pi, 2), spot(np.pi, 101)
BEARING = np.radians(65.0)


def post(x, y):
    """Return level ground with a post of 0.3 m, 0.52 m away from the origin."""
    away = np.hypot(x - 0.52 * np.cos(BEARING), y - 0.52 * np.sin(BEARING))
    return np.where(away < 0.06, 0.3, 0.0)


POST = make_terrain(post, 0.02, 2.0)


@pytest.mark.parametrize("policy", TORQUE_POLICIES)
def test_a_turn_fails_where_only_its_middle_does(policy):
    options = SweepOptions(policy)
    prediction, verdict = judge_path(LSR1, POST, HALF_TURN, options)
    assert not judge_path(LSR1, POST, HALF_TURN[:1], options)[1].reasons[0]
    assert prediction.settled.all()
    assert verdict.first_failure == 1
    assert not judge_path(LSR1, POST, DENSE, options)[1].traversable
    stopped = judge_path(LSR1, POST, HALF_TURN, options, stop_at_failure=True)[1]
    in_parts = PartwiseJudge(LSR1, POST, HALF_TURN, options)
    assert len(list(in_parts.parts())) == 1
    assert stopped.reasons == in_parts.verdict().reasons == verdict.reasons


def test_the_drift_of_fixed_wheels_in_a_turn_is_that_of_dense_waypoints():
    coarse, fine = (
        judge_path(FIXED, plane(0.15, 0.0, half=3.0), path, SweepOptions("servo"))[0]
        for path in (HALF_TURN, DENSE)
    )
    assert coarse.drift[1] == pytest.approx(fine.drift.max(axis=0), rel=0.05)
    assert coarse.drift[1].max() > 0.0
