# SPDX-License-Identifier: Apache-2.0
"""Steering: wheels roll about the centre of rotation, within their limits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_physics import Rover
from rover_physics.errors import ModelError
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.rover.linkage import pack_linkage
from rover_physics.rover.steered_drive import STAND_ERROR, STILL, SteeredDrive, steer_wheels
from rover_physics.rover.steering_joints import (
    can_turn_on_the_spot,
    check_joint_limit,
    tightest_radius,
)
from support.rovers import ALL_STEER, FIXED, LSR1, M2020

speeds = st.floats(-0.1, 0.1)


def steer(rover: Rover, *motion: float) -> tuple[bool, np.ndarray, np.ndarray]:
    """Return whether the wheels can follow, steering angles [rad] and rolling speeds [m/s]."""
    angles, rolling = np.full(6, np.nan), np.full(6, np.nan)
    can_follow = steer_wheels(pack_linkage(rover), np.array(motion, float), angles, rolling)
    return bool(can_follow), angles, rolling


def with_limit(rover: Rover, limit: float) -> Rover:
    return replace(rover, steering=replace(rover.steering, limit=limit))


@given(st.sampled_from([LSR1, M2020, ALL_STEER, FIXED]), speeds, speeds, st.floats(-0.2, 0.2))
def test_every_wheel_rolls_where_the_body_takes_it_as_far_as_it_steers(rover, vx, vy, rate):
    steered = rover.steering.wheels if rover.steering else ()
    if len(steered) == 2:
        vy = 0.0  # fixed wheels cannot go sideways
    can_follow, angles, rolling = steer(rover, vx, vy, rate)
    left = np.array([rover.suspension.wheels[name][:2] for name in WHEEL_POSITIONS])
    wheels = np.vstack([left * [1.0, -1.0], left])
    carried = np.column_stack([vx - rate * wheels[:, 1], vy + rate * wheels[:, 0]])
    turns = np.array([name in steered for name in WHEEL_POSITIONS] * 2)
    rolled = rolling[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    assert can_follow
    assert np.abs(angles).max() <= np.pi / 2
    limit = rover.steering.limit if rover.steering else 0.0
    follows = turns & (np.abs(angles) < limit)  # 1.57 rad is a little less than a right angle
    rounded = 1.01 * STILL * np.hypot(*carried.T).max()
    assert rolled[follows] == pytest.approx(carried[follows], abs=rounded)
    assert not angles[~turns].any()
    assert rolling[~turns] == pytest.approx(carried[~turns, 0], abs=1e-15)


def test_a_limit_that_is_rounded_down_from_a_right_angle_allows_it():
    can_follow, angles, rolling = steer(with_limit(ALL_STEER, 1.57), 0.0, 0.03, 0.0)
    assert can_follow
    assert angles.tolist() == [1.57] * 6 and rolling == pytest.approx([0.03] * 6)


@pytest.mark.parametrize("rover", [LSR1, M2020, ALL_STEER], ids=["lsr1", "m2020", "all_steer"])
def test_wheels_beside_and_at_the_centre_of_a_turn_keep_their_angle_where_poses_are_rounded(rover):
    for radius in (tightest_radius(rover), rover.suspension.wheels["middle"][1]):
        motions = [(0.03, 0.0, 0.03 / radius + off) for off in (0.0, 2e-6, -2e-6)]
        angles = [steer(rover, *motion)[1] for motion in motions]
        np.testing.assert_allclose(angles[1:], angles[:1] * 2, atol=1e-3)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
@pytest.mark.parametrize("ahead", [0.03, -0.03], ids=["forward", "backward"])
def test_wheels_turn_on_in_one_direction_as_a_curve_gets_as_tight_as_it_can(ahead, side):
    radius = tightest_radius(LSR1)
    bends = side / (radius * np.array([1.05, 1.0 + 1e-9, 1.0]))
    wider, *tightest = (steer(LSR1, ahead, 0.0, ahead * bend)[1] for bend in bends)
    assert np.abs(np.array(tightest) - wider).max() < 0.2


# How tightly a rover turns


@pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)
@pytest.mark.parametrize("limit", [0.2, 1.2])
def test_the_wheels_reach_their_limit_on_the_tightest_curve(rover, limit):
    narrow = with_limit(rover, limit)
    radius = tightest_radius(narrow)
    assert steer(narrow, 0.03, 0.0, 0.03 / (1.001 * radius))[0]
    assert not steer(narrow, 0.03, 0.0, 0.03 / (0.99 * radius))[0]


def test_fixed_wheels_curve_by_the_wheelbase_and_quarter_turns_let_the_inner_wheels_stand():
    assert tightest_radius(FIXED) == pytest.approx(0.8)
    assert tightest_radius(with_limit(LSR1, 1.57)) == pytest.approx(0.31)
    assert tightest_radius(with_limit(M2020, np.pi)) == pytest.approx(1.063)


def test_a_rover_turns_on_the_spot_if_its_wheels_reach_the_tangent():
    needed = np.arctan2(0.40, 0.31)
    assert can_turn_on_the_spot(with_limit(LSR1, needed + 1e-6))
    assert not can_turn_on_the_spot(with_limit(LSR1, needed - 1e-6))
    assert not can_turn_on_the_spot(FIXED)


# Commands: the drive waits for wheels that steer


def test_a_motion_beyond_the_limit_is_refused_by_wheel_and_angle():
    narrow = with_limit(LSR1, 0.4)
    aims = SteeredDrive(narrow).aim(0.0, 0.1)
    assert "steering angle of" in aims.refusal and "22.9 deg" in aims.refusal
    assert np.abs(aims.angles).max() == 0.4


def test_wheels_turn_at_their_rate_and_the_drive_waits_for_them():
    drive, angles = SteeredDrive(LSR1), np.zeros(6)
    aims = drive.aim(0.0, 0.1).angles
    assert drive.share(angles, aims) == 0.0
    shares = []
    for _ in range(200):
        before, angles = angles, drive.turn(angles, aims, 0.02)
        assert np.abs(angles - before).max() <= 0.35 * 0.02 + 1e-12
        shares.append(drive.share(angles, aims))
    moving = [share for share in shares if share > 0.0]
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert moving[0] == pytest.approx(np.cos(STAND_ERROR), abs=0.01)


def test_joints_that_do_not_reach_what_is_planned_are_refused():
    with pytest.raises(ModelError, match=r"reach 0\.52 rad.*up to 1\.57 rad.*at most 0\.52"):
        check_joint_limit(LSR1, 0.52)
    check_joint_limit(LSR1, 1.57)
    check_joint_limit(FIXED, 0.1)
    wide = with_limit(LSR1, 3.0)
    check_joint_limit(wide, 1.571)  # no wheel needs more than a quarter turn
