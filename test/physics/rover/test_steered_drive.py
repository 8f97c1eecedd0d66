# SPDX-License-Identifier: Apache-2.0
"""Commands become steering angles and wheel speeds; the drive waits for wheels that steer."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.errors import ModelError
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steered_drive import STAND_ERROR, SteeredDrive
from rover_physics.rover.steering_joints import (
    check_joint_limit,
    steered_wheels,
    steering_joints,
)

LSR1 = load_rover("lsr1")


def test_the_joints_are_those_of_the_steered_axles_in_wheel_order():
    assert steering_joints(LSR1) == (
        "rear_right_steering", "front_right_steering", "rear_left_steering", "front_left_steering",
    )  # fmt: skip
    assert steered_wheels(LSR1).tolist() == [0, 2, 3, 5]
    assert steering_joints(replace(LSR1, steering=None)) == ()


def test_a_motion_beyond_the_limit_is_refused_by_wheel_and_angle():
    narrow = replace(LSR1, steering=replace(LSR1.steering, limit=0.4))
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


def test_aims_are_those_of_the_arc_and_fixed_wheels_are_never_waited_for():
    aims = SteeredDrive(LSR1).aim(0.06, 0.06)
    assert aims.angles[5] == pytest.approx(np.arctan2(0.4, 1.0 - 0.31))
    assert aims.speeds[2] == pytest.approx(0.06 * np.hypot(1.31, 0.4))
    drive = SteeredDrive(replace(LSR1, steering=None))
    aims = drive.aim(0.06, 0.1)
    assert not aims.angles.any() and drive.share(np.zeros(6), aims.angles) == 1.0


def test_joints_that_do_not_reach_what_is_planned_are_refused():
    with pytest.raises(ModelError, match=r"reach 0\.52 rad.*up to 1\.57 rad.*at most 0\.52"):
        check_joint_limit(LSR1, 0.52)
    check_joint_limit(LSR1, 1.57)
    check_joint_limit(replace(LSR1, steering=None), 0.1)
    wide = replace(LSR1, steering=replace(LSR1.steering, limit=3.0))
    check_joint_limit(wide, 1.571)  # no wheel needs more than a quarter turn
