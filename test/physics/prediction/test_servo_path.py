# SPDX-License-Identifier: Apache-2.0
"""What only the path shows under policy "servo": lifts, wedged wheels, drift."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import predict_in_parts
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rough_grounds import bouldered, plane

LSR1 = load_rover("lsr1")
ROVER = unlimited(LSR1)
SERVO = SweepOptions(policy="servo")


def arc(curvature: float, length: float = 1.2) -> np.ndarray:
    turn = curvature * np.linspace(0.0, length, 61)
    return np.column_stack([np.sin(turn), 1.0 - np.cos(turn), curvature * turn]) / curvature


def test_a_wheel_that_hops_stops_no_rover_with_servos():
    bump = drive_ground("bump_one_side", 0.18)
    options = replace(SERVO, friction=1.0, max_torque=2.44)
    rover = unlimited(LSR1)
    servo = judge_path(rover, bump, drive_path(), options)[0]
    lifts = np.concatenate([servo.lift_height.max(axis=1), servo.between.lift_height.max(axis=1)])
    assert (servo.wheel_loads >= 0.0).all()
    assert 0.0 < lifts.max() < LSR1.wheel.radius
    assert hold_against_limits(rover, servo).traversable
    assert (
        hold_against_limits(
            rover, judge_path(rover, bump, drive_path(), replace(options, policy="equal"))[0]
        ).code
        == "wheel_lift"
    )


def test_lift_heights_are_the_sums_of_the_speeds():
    bump = drive_ground("bump_one_side", 0.238)
    options = replace(SERVO, friction=0.8, max_torque=1.63)
    found = judge_path(unlimited(LSR1), bump, drive_path(), options)[0]
    row = int(np.flatnonzero((found.lift_rate > 0.0).any(axis=1))[0])
    wheel = int(np.argmax(found.lift_rate[row]))
    end = row + int(np.argmin(found.lift_rate[row:, wheel] > 0.0))
    rates = found.lift_rate[row - 1 : end, wheel] / found.speed_share[row - 1 : end]
    expected = 0.01 * (0.5 * (rates[1:] + rates[:-1])).sum()
    assert found.lift_height[end - 1, wheel] == pytest.approx(expected, rel=0.05)
    assert found.lift_height[end, wheel] == 0.0


def test_a_wheel_that_falls_into_a_slot_as_wide_as_itself_is_wedged():
    rover, options = unlimited(LSR1), replace(SERVO, friction=0.8, max_torque=2.44)
    slot = drive_ground("ditch", 0.183)
    verdict = hold_against_limits(rover, judge_path(rover, slot, drive_path(), options)[0])
    assert (verdict.code, "wedged" in verdict.reason) == ("friction", True)
    narrow = hold_against_limits(
        rover, judge_path(rover, drive_ground("ditch", 0.10), drive_path(), options)[0]
    )
    assert narrow.traversable


def test_a_rover_that_cannot_steer_turns_off_an_arc_and_one_that_can_does_not():
    fixed, flat = replace(LSR1, steering=None), plane(0.0, 0.0, half=2.0)
    path = arc(0.6)
    drift = judge_path(fixed, flat, path, SERVO)[0].drift
    assert drift[-1, 0] > 0.2 and (np.diff(drift[:40, 0]) >= -1e-9).all()
    assert "turns off its path" in judge_path(fixed, flat, path, SERVO)[1].reason
    assert judge_path(LSR1, flat, path, SERVO)[0].drift.max() < 0.02
    assert judge_path(LSR1, flat, path, SERVO)[1].traversable


def test_other_policies_neither_drift_nor_lift(policy="optimal"):
    x = np.linspace(-0.5, 0.5, 21)
    path = np.column_stack([x, 0.0 * x, 0.0 * x])
    found = judge_path(LSR1, bouldered(3), path, SweepOptions(policy=policy))[0]
    assert (found.speed_share == 1.0).all()
    assert not (found.drift.any() or found.lift_height.any() or found.deviation.any())


def test_a_path_in_parts_is_the_whole_path(monkeypatch):
    monkeypatch.setattr("rover_physics.prediction.sweep.PART", 50)
    rover, ground = unlimited(LSR1), drive_ground("bump_one_side", 0.18)
    options = replace(SERVO, friction=1.0, max_torque=2.44)
    whole = judge_path(rover, ground, drive_path(), options)[0]
    for part in predict_in_parts(pack_model(rover, ground, options), drive_path()):
        rows = slice(part.context, None)
        here = part.first + np.arange(len(part.prediction.poses) - part.context)
        for name in ("wheel_loads", "torque", "speed_share", "time", "energy"):
            np.testing.assert_allclose(
                getattr(part.prediction, name)[rows], getattr(whole, name)[here], rtol=1e-9
            )


def energies(heights, spacing=0.01) -> np.ndarray:
    options = SweepOptions(policy="servo", friction=0.8)
    swept = [
        judge_path(ROVER, drive_ground("step", height), drive_path(spacing), options)[0]
        for height in heights
    ]
    return np.array([prediction.energy[-1] for prediction in swept])


def test_a_higher_step_costs_more_energy_also_where_a_wheel_rolls_over_its_edge():
    """Up to a step as high as a wheel's radius, the wheel climbs no face."""
    found = energies((0.04, 0.06, 0.08, 0.1, 0.12, 0.14))
    assert (np.diff(found) > 1.5).all()


def test_energy_and_time_over_steps_hardly_depend_on_the_spacing_of_waypoints():
    heights = (0.06, 0.1, 0.14)
    np.testing.assert_allclose(energies(heights, 0.004), energies(heights, 0.02), rtol=0.1)
