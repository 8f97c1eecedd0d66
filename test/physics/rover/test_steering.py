# SPDX-License-Identifier: Apache-2.0
"""Steering: wheels roll about the centre of rotation, within their limits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.rover.linkage import pack_linkage
from rover_physics.rover.model import Rover, Steering
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering import steer_wheels

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
ALL_STEER = replace(LSR1, steering=Steering(("rear", "middle", "front"), np.pi / 2, 0.35))
FIXED = replace(LSR1, steering=None)
speeds = st.floats(-0.1, 0.1)
few = settings(max_examples=100)


def steer(rover: Rover, *motion: float) -> tuple[bool, np.ndarray, np.ndarray]:
    """Return whether the wheels can follow, steering angles [rad] and rolling speeds [m/s]."""
    body = rover.masses.body
    linkage = pack_linkage(rover, body.mass, np.array(body.com))
    angles, rolling = np.full(6, np.nan), np.full(6, np.nan)
    can_follow = steer_wheels(linkage, np.array(motion, float), angles, rolling)
    return bool(can_follow), angles, rolling


def wheels_of(rover: Rover) -> np.ndarray:
    left = np.array([rover.suspension.wheels[name][:2] for name in ("rear", "middle", "front")])
    return np.vstack([left * [1.0, -1.0], left])


@pytest.mark.parametrize("speed", [0.03, -0.03])
@pytest.mark.parametrize("rover", [LSR1, ALL_STEER, FIXED], ids=["ends", "all", "fixed"])
def test_on_a_straight_way_no_wheel_is_turned_and_all_roll_alike(rover, speed):
    can_follow, angles, rolling = steer(rover, speed, 0.0, 0.0)
    assert can_follow
    assert angles.tolist() == [0.0] * 6 and rolling.tolist() == [speed] * 6


@few
@given(st.sampled_from([LSR1, M2020, ALL_STEER, FIXED]), speeds, speeds, st.floats(-0.2, 0.2))
def test_every_wheel_rolls_where_the_body_takes_it_as_far_as_it_steers(rover, vx, vy, rate):
    steered = rover.steering.wheels if rover.steering else ()
    if len(steered) == 2:
        vy = 0.0  # fixed wheels cannot go sideways
    can_follow, angles, rolling = steer(rover, vx, vy, rate)
    wheels = wheels_of(rover)
    carried = np.column_stack([vx - rate * wheels[:, 1], vy + rate * wheels[:, 0]])
    turns = np.array([name in steered for name in ("rear", "middle", "front")] * 2)
    rolled = rolling[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    assert can_follow
    assert np.abs(angles).max() <= np.pi / 2
    limit = rover.steering.limit if rover.steering else 0.0
    follows = turns & (np.abs(angles) < limit)  # 1.57 rad is a little less than a right angle
    assert rolled[follows] == pytest.approx(carried[follows], abs=1e-9)
    assert not angles[~turns].any()
    assert rolling[~turns] == pytest.approx(carried[~turns, 0], abs=1e-15)


def test_on_the_spot_the_right_wheels_roll_forwards_and_the_left_ones_back():
    can_follow, angles, rolling = steer(LSR1, 0.0, 0.0, 0.1)
    assert can_follow
    end = np.arctan2(0.40, 0.31)
    assert angles == pytest.approx([-end, 0.0, end, end, 0.0, -end])
    sides = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    assert rolling == pytest.approx(0.1 * np.hypot(*wheels_of(LSR1).T) * sides)


def test_a_curve_beyond_the_limit_cannot_be_followed_and_the_angle_is_told():
    stiff = replace(LSR1, steering=Steering(("rear", "front"), 0.4, 0.35))
    can_follow, angles, _ = steer(stiff, 0.03, 0.0, 0.03)
    assert not can_follow
    assert np.abs(angles).max() == pytest.approx(np.arctan(0.4 / (1.0 - 0.31)))
    assert steer(stiff, 0.03, 0.0, 0.006)[0]


def test_a_limit_that_is_rounded_down_from_a_right_angle_allows_it():
    rounded = replace(ALL_STEER, steering=Steering(("rear", "middle", "front"), 1.57, 0.35))
    can_follow, angles, rolling = steer(rounded, 0.0, 0.03, 0.0)
    assert can_follow
    assert angles.tolist() == [1.57] * 6 and rolling == pytest.approx([0.03] * 6)


def test_fixed_wheels_of_a_steered_rover_cannot_go_sideways():
    can_follow, angles, _ = steer(M2020, 0.03, 0.03, 0.0)
    assert not can_follow
    assert angles == pytest.approx([np.pi / 4] * 6)
    assert steer(ALL_STEER, 0.03, 0.03, 0.0)[0]
