# SPDX-License-Identifier: Apache-2.0
"""Verdicts under policy "servo" agree with drives of speed servos in MuJoCo, along curves too."""

from functools import lru_cache

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from support.reference_drives import (
    PASSED,
    Curve,
    curve_ground,
    curve_options,
    curve_path,
    curve_rover,
    judge_drives,
    predict_trace,
    read_curves,
)

WEIGHT = load_rover("lsr1").weight


@lru_cache
def drives() -> list:
    return [(drive, verdict) for drive, _, verdict in judge_drives("servo")]


@lru_cache
def curves() -> list:
    judged = []
    for curve in read_curves():
        rover, ground = curve_rover(curve), curve_ground(curve.kind, curve.size)
        prediction = judge_path(rover, ground, curve_path(curve), curve_options(curve))[0]
        judged.append((curve, hold_against_limits(rover, prediction)))
    return judged


def along_traces(*modes: str) -> list[tuple[Curve, np.ndarray, np.ndarray]]:
    """Return curves with sizes of wheel forces and torques (k, 6) where the model drives."""
    found = []
    for curve in read_curves():
        if curve.mode in modes and len(curve.poses):
            prediction = predict_trace(curve)
            parts = (prediction.wheel_loads, prediction.tangential, prediction.lateral)
            forces = np.sqrt(sum(part**2 for part in parts))
            drives = prediction.speed_share > 0.0
            found.append(
                (
                    curve,
                    (forces - curve.forces)[drives] / WEIGHT,
                    np.abs([prediction.torque[drives], curve.torques[drives]]).mean(axis=(1, 2)),
                )
            )
    return found


@pytest.mark.long
def test_at_least_57_of_60_drives_end_as_judged():
    assert (
        sum(verdict.traversable == (drive.outcome == PASSED) for drive, verdict in drives()) >= 57
    )


@pytest.mark.long
def test_nothing_passable_with_servos_got_stuck_or_tipped():
    passable = [drive for drive, verdict in drives() if verdict.traversable]
    assert len(passable) >= 25
    assert [drive.label for drive in passable if drive.outcome != PASSED] == []


@pytest.mark.long
def test_servos_pass_what_equal_torques_pass_and_optimal_torques_what_servos_pass():
    verdicts = [
        [verdict.traversable for _, _, verdict in judge_drives(policy)]
        for policy in ("equal", "servo", "optimal")
    ]
    equal, servo, optimal = np.array(verdicts)
    assert (equal <= servo).all() and (servo <= optimal).all()
    assert equal.sum() < servo.sum() < optimal.sum()


@pytest.mark.slow
def test_at_least_nine_curves_of_ten_are_kept_as_judged():
    assert len(curves()) == 25
    agree = [verdict.traversable == curve.kept for curve, verdict in curves()]
    assert np.mean(agree) >= 0.9


@pytest.mark.slow
def test_no_curve_is_passed_that_the_rover_left():
    left = [curve.label for curve, verdict in curves() if verdict.traversable and not curve.kept]
    assert left == []


@pytest.mark.slow
def test_fixed_wheels_leave_their_arc_and_the_reason_says_so():
    for curve, verdict in curves():
        if curve.mode == "skid":
            assert verdict.code == "friction" and "turns off its path" in verdict.reason


@pytest.mark.parametrize("modes", [("steered", "spot"), ("skid", "skid_spot")])
def test_wheel_forces_along_curves_are_those_of_mujoco(modes):
    errors = np.concatenate([np.abs(error).ravel() for _, error, _ in along_traces(*modes)])
    assert errors.size >= 1500
    assert np.median(errors) <= 0.03


def test_wheel_torques_in_skidding_are_those_of_mujoco():
    ratios = [ours / theirs for _, _, (ours, theirs) in along_traces("skid", "skid_spot")]
    assert len(ratios) == 10
    assert np.median(np.abs(np.array(ratios) - 1.0)) <= 0.25
