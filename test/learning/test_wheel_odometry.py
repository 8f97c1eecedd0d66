# SPDX-License-Identifier: Apache-2.0
"""Wheel odometry learns how wheels creep on slopes, and its covariance tells what it misses."""

import numpy as np
import pytest

from rover_planner.learning.drive_log import PITCH, RATES, ROLL, TIME, TORQUES, WIDTH
from rover_planner.learning.wheel_odometry import WheelOdometry
from support.rovers import LSR1 as ROVER

SPEED, RATE = 0.06, 10.0
TURNING = SPEED / ROVER.wheel.radius
LARGEST = 0.5 * ROVER.weight * ROVER.wheel.radius / 6.0
"""Rate of the wheels [rad/s], and torque at which friction of 0.5 is used up [N m]."""
CREEP, DRIFT, SCATTER = 0.12, 0.18, 0.02
"""Share of the way that is lost per slope, gone aside per side slope, and its scatter."""


def measure(time, pitch=0.0, roll=0.0, torques=np.nan):
    """Return a row of measurements of wheels that turn evenly."""
    row = np.full(WIDTH, np.nan)
    row[[TIME, PITCH, ROLL]] = time, pitch, roll
    row[RATES], row[TORQUES] = TURNING, torques
    return row


def drive(odometry, seed, pitch, roll, seconds=60.0, teach=False):
    """Drive with creep; return the true end (3,)."""
    rng = np.random.default_rng(seed)
    true, piece = np.zeros(3), 0.0
    for k in range(round(seconds * RATE)):
        if k % 50 == 0:  # what is uneven lasts for a while
            piece = SCATTER * rng.standard_normal()
        yaw_rate = 0.02 * np.sin(0.01 * k)
        odometry.take(measure(k / RATE, pitch, roll), yaw_rate)
        if k:
            step = SPEED * np.cos(pitch) / RATE
            true[2] += yaw_rate / RATE
            c, s = np.cos(true[2]), np.sin(true[2])
            ahead = 1.0 + CREEP * np.tan(pitch) + piece
            left = -DRIFT * np.tan(roll)
            true[:2] += step * np.array([ahead * c - left * s, ahead * s + left * c])
        if teach:
            odometry.learn(true)
    return true


@pytest.fixture(scope="module")
def taught():
    """Return an odometry that has learned on two slopes and two side slopes."""
    odometry = WheelOdometry(ROVER)
    for seed, (pitch, roll) in enumerate([(0.0, 0.0), (-0.3, 0.1), (-0.15, -0.2), (0.2, 0.25)]):
        first = WheelOdometry(ROVER)
        first.forward, first.side = odometry.forward, odometry.side
        drive(first, seed, pitch, roll, teach=True)
    return odometry


def follow(taught, seed, pitch, roll, friction=ROVER.friction):
    """Return odometry and truth of a drive, not measured in another way; a friction is known."""
    odometry = WheelOdometry(ROVER)
    odometry.forward, odometry.side = taught.forward, taught.side
    if friction is not None:
        odometry.friction, odometry.friction_deviation = friction, 0.05 * friction
    return odometry, drive(odometry, seed, pitch, roll)


@pytest.mark.parametrize(("pitch", "roll"), [(-0.35, 0.0), (0.0, 0.3), (-0.2, -0.2)])
def test_what_was_learned_halves_the_drift_on_slopes(taught, pitch, roll):
    known, true = follow(taught, 10, pitch, roll)
    plain = WheelOdometry(ROVER)
    drive(plain, 10, pitch, roll)
    miss, plain_miss = (np.hypot(*(one.pose - true)[:2]) for one in (known, plain))
    assert miss < 0.5 * plain_miss


def test_the_covariance_is_that_of_the_misses(taught):
    rng = np.random.default_rng(5)
    squares = []
    for seed in range(12):
        odometry, true = follow(taught, 100 + seed, *rng.uniform(-0.3, 0.3, 2))
        miss = (odometry.pose - true)[:2]
        squares.append(miss @ np.linalg.solve(odometry.covariance[:2, :2], miss))
    assert 0.2 < np.mean(squares) < 4.0
    assert np.mean(np.array(squares) < 5.99) > 0.9


@pytest.mark.parametrize(("pitch", "friction", "ratio"), [(-0.2, 0.21, 25.0), (-0.3, None, 4.0)])
def test_where_all_friction_is_used_or_it_is_unknown_the_way_up_a_slope_is_less_sure(
    taught, pitch, friction, ratio
):
    sure, _ = follow(taught, 3, pitch, 0.0)
    unsure, _ = follow(taught, 3, pitch, 0.0, friction)
    assert unsure.covariance[0, 0] > ratio * sure.covariance[0, 0]


@pytest.mark.parametrize(("deviation", "furthest"), [(0.03, 0.2), (0.3, 1.2)])
def test_a_rover_that_pushes_against_an_obstacle_with_all_friction_stands(deviation, furthest):
    odometry = WheelOdometry(ROVER)
    odometry.friction, odometry.friction_deviation = 0.5, deviation
    for k in range(200):
        odometry.take(measure(k / RATE, torques=0.98 * LARGEST), 0.0)
    assert odometry.pose[0] < furthest
    assert odometry.pose[0] ** 2 < 5.99 * odometry.covariance[0, 0]
    assert odometry.speed < SPEED


def test_a_rover_that_slides_down_a_side_slope_may_be_where_it_slid(taught):
    odometry, _ = follow(taught, 3, 0.0, 0.33, friction=0.34)
    aside = odometry.pose[1] + 0.5 * odometry.pose[0] * np.array([-1.0, 1.0])
    misses = np.column_stack([np.zeros(2), aside - odometry.pose[1]])
    spread = np.linalg.solve(odometry.covariance[:2, :2], misses.T).T
    assert ((misses * spread).sum(axis=1) < 5.99).all()


@pytest.mark.parametrize("value", [ROVER.wheel.max_torque, 1e3, -1e3, np.nan])
def test_a_torque_that_cannot_be_believed_does_not_count(value):
    rng, way = np.random.default_rng(1), 200 / RATE * SPEED
    odometry = WheelOdometry(ROVER)
    odometry.friction, odometry.friction_deviation = 0.5, 0.03
    for k in range(201):
        torques = 0.4 * LARGEST * (1.0 + 0.05 * rng.standard_normal(6))
        torques[2] = value
        odometry.take(measure(k / RATE, torques=torques), 0.0)
    assert odometry.pose[0] == pytest.approx(way, rel=0.05)
    assert odometry.covariance[0, 0] < (0.1 * way) ** 2


@pytest.mark.parametrize("silent", [0.0, 7200.0, -100.0], ids=["jump", "silence", "set back"])
def test_a_pose_that_jumps_and_a_time_that_was_not_heard_teach_nothing(silent):
    odometry = WheelOdometry(ROVER)
    for k in range(200):
        odometry.take(measure(k / RATE), 0.0)
        odometry.learn(np.array([SPEED * k / RATE, 0.0, 0.0]))
    before = odometry.forward.covariance.copy()
    away = 0.5 if silent else 10.0
    for k in range(200, 280):
        odometry.take(measure(k / RATE + silent), 0.0)
        odometry.learn(np.array([SPEED * k / RATE + away, 0.0, 0.0]))
    assert (np.diag(odometry.forward.covariance) <= np.diag(before)).all()
