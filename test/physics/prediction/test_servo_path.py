# SPDX-License-Identifier: Apache-2.0
"""What only the path shows under policy "servo": lifts, momentum, drift."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, judge_path, judge_paths
from support.grounds import fractal, make_terrain, plane
from support.paths import arc_of, poses_at
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rovers import LSR1

ROVER = unlimited(LSR1)
SERVO = SweepOptions(policy="servo")


def drive(kind: str, size: float, policy: str = "servo", spacing: float = 0.01, **options):
    """Return prediction and verdict of a drive over an obstacle."""
    asked = ROVER, drive_ground(kind, size), [drive_path(spacing)], SweepOptions(policy, **options)
    return judge_paths(*asked, check_entrapment=False)[0]


def test_a_wheel_that_hops_stops_no_rover_with_servos():
    servo, verdict = drive("bump_one_side", 0.18, friction=1.0, max_torque=2.44)
    lifts = np.concatenate([servo.lift_height.max(axis=1), servo.between.lift_height.max(axis=1)])
    assert (servo.wheel_loads >= 0.0).all()
    assert 0.0 < lifts.max() < LSR1.wheel.radius
    assert verdict.traversable
    equal = drive("bump_one_side", 0.18, "equal", friction=1.0, max_torque=2.44)[1]
    assert equal.code == "wheel_lift"


def test_lift_heights_are_the_sums_of_the_speeds():
    found = drive("bump_one_side", 0.238, friction=0.8, max_torque=1.63)[0]
    row = int(np.flatnonzero((found.lift_rate > 0.0).any(axis=1))[0])
    wheel = int(np.argmax(found.lift_rate[row]))
    end = row + int(np.argmin(found.lift_rate[row:, wheel] > 0.0))
    rates = found.lift_rate[row - 1 : end, wheel] / found.speed_share[row - 1 : end]
    expected = 0.01 * (0.5 * (rates[1:] + rates[:-1])).sum()
    assert found.lift_height[end - 1, wheel] == pytest.approx(expected, rel=0.05)
    assert found.lift_height[end, wheel] == 0.0


@pytest.mark.parametrize("max_torque", [0.1, 0.3])
def test_a_turn_on_the_spot_that_weak_motors_do_not_brake_has_a_finite_speed(max_torque):
    turn = poses_at(0.0, yaw=np.arange(0.0, 3.1, 0.05))
    found = judge_path(LSR1, fractal(4), turn, replace(SERVO, max_torque=max_torque))[0]
    assert (found.speed_share[found.settled] > 1.5).any()
    assert np.isfinite(found.speed_share[found.settled]).all()


def over_a_hill(speed: float, max_torque: float, repeat: int = 1):
    """Return prediction and verdict of the way up a hill of 0.1 m at a speed [m/s].

    Each waypoint is told `repeat` times.
    """
    ground = make_terrain(lambda x, y: 0.05 * np.cos(np.pi * x / 1.5), 0.02, 2.0)
    options = replace(SERVO, friction=0.8, max_torque=max_torque)
    path = np.repeat(drive_path()[:130], repeat, axis=0)
    return judge_path(replace(ROVER, nominal_speed=speed), ground, path, options)


def test_momentum_carries_a_rover_over_a_place_where_little_force_is_missing():
    low, high = 0.1, 2.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if over_a_hill(0.01, middle)[1].traversable else (middle, high)
    slow, fast = (over_a_hill(speed, 0.997 * low) for speed in (0.01, 0.1))
    assert "stall" in slow[1].reason and fast[1].traversable
    assert over_a_hill(0.1, 0.997 * low, repeat=2)[1].traversable
    carried = fast[0].results["deficit"] > 0.0
    assert 0.0 < fast[0].speed_share[carried].min() < fast[0].speed_share[~carried].min()


def test_a_rover_that_its_motors_cannot_hold_runs_away_on_a_long_slope_alone():
    options, ground = replace(SERVO, friction=0.8, max_torque=0.25), plane(-0.25, 0.0, half=2.0)
    short, long = (judge_path(ROVER, ground, drive_path()[:n], options) for n in (8, 40))
    assert short[1].traversable and (np.diff(short[0].speed_share) > 0.0).all()
    assert "runs away" in long[1].reason


def test_a_higher_step_costs_more_energy_hardly_depending_on_the_spacing_of_waypoints():
    """Up to a step as high as a wheel's radius, the wheel climbs no face."""
    coarse, fine = (
        np.array([drive("step", height, spacing=spacing, friction=0.8)[0].energy[-1]
                  for height in (0.06, 0.1, 0.14)])
        for spacing in (0.02, 0.005)
    )  # fmt: skip
    assert (np.diff(coarse) > 3.0).all()
    np.testing.assert_allclose(fine, coarse, rtol=0.1)


def test_a_turn_about_a_wheel_costs_the_power_of_the_wheels_in_its_time():
    radius = LSR1.suspension.wheels["middle"][1]
    path = arc_of(1.0 / radius, np.linspace(0.0, 0.4, 41))
    found = judge_path(LSR1, fractal(4), path, SERVO)[0]
    assert found.energy[-1] == pytest.approx(np.trapezoid(found.power, found.time), rel=0.15)


def test_drift_on_an_even_slope_builds_up_over_a_wheelbase_whatever_rounding_makes_of_it():
    path, options = poses_at(np.linspace(-1.2, 1.2, 61)), replace(SERVO, friction=0.4)
    found = judge_path(ROVER, plane(0.0, 0.25, half=2.0), path, options)[0]
    slide = found.results["drift"][25:, 1]
    assert slide[0] > 0.0
    assert slide == pytest.approx(slide[0], rel=1e-6)
