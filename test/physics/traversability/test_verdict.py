# SPDX-License-Identifier: Apache-2.0
"""Limits: each broken limit is told with its code, the wheel or joint, the value and the limit."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rover_physics import PoseStatus, judge_path
from rover_physics.numerics.interruption import interruptible
from rover_physics.results.record import numbers_of
from rover_physics.traversability.verdict import hold_against_limits
from support.grounds import plane
from support.paths import poses_at
from support.rovers import LSR1

POSES = poses_at(np.linspace(-0.2, 0.2, 5))


@pytest.fixture(scope="module")
def fine():
    """Return the prediction of a path over level ground, on which nothing is broken."""
    return judge_path(LSR1, plane(0.0, 0.0), POSES)[0]


def with_value(prediction, name, row, value, column=()):
    """Return the prediction with one number changed."""
    values = getattr(prediction, name).copy()
    values[(row, *column)] = value
    return prediction.change(**{name: values})


def with_status(prediction, row, status):
    """Return the prediction as if one waypoint had not settled."""
    results = prediction.results.copy()
    numbers_of(results)[row] = np.nan
    results["status"][row] = status
    return replace(prediction, results=results)


@pytest.mark.parametrize(
    ("code", "name", "column", "value", "words"),
    [
        ("tilt", "roll", (), 0.53, ["30.4 deg", "29.8 deg"]),
        ("tip_over", "tip_over_ratio", (), 0.29, ["0.29", "0.30"]),
        ("wheel_lift", "wheel_loads", (3,), -0.25, ["rear_left", "-0.25 N", "equal"]),
        ("friction", "friction_utilisation", (2,), 1.25, ["front_right", "1.25", "1.00"]),
        ("torque", "torque_saturation", (4,), 1.5, ["middle_left", "1.50", "1.00"]),
        ("sinkage", "sinkage", (1,), 0.04, ["middle_right wheel sinks deeper", "0.033 m"]),
        ("wheel_drop", "wheel_drop", (5,), 0.11, ["front_left wheel drops", "0.110 m", "0.100 m"]),
        ("belly", "belly_clearance", (), 0.011, ["0.011 m", "0.020 m"]),
        ("suspension", "rocker_angle", (0,), 0.61, ["right rocker", "0.61", "0.60"]),
        ("suspension", "bogie_angle", (0,), -0.95, ["right bogie", "-0.95", "-0.90"]),
    ],
)
def test_a_broken_limit_is_told_at_its_waypoint(fine, code, name, column, value, words):
    verdict = hold_against_limits(LSR1, with_value(fine, name, 3, value, column))
    assert (verdict.traversable, verdict.first_failure, verdict.code) == (False, 3, code)
    assert verdict.codes == ("", "", "", code, "")
    assert verdict.reason == verdict.reasons[3] and all(w in verdict.reason for w in words)


def test_a_value_at_its_limit_is_allowed(fine):
    for name, column, value in (
        ("roll", (), 0.52), ("tip_over_ratio", (), 0.3), ("friction_utilisation", (1,), 1.0),
        ("torque_saturation", (1,), 1.0), ("belly_clearance", (), 0.02),
        ("rocker_angle", (0,), -0.60), ("bogie_angle", (1,), 0.90), ("wheel_loads", (5,), 0.0),
    ):  # fmt: skip
        at_limit = with_value(fine, name, 2, value, column)
        assert hold_against_limits(LSR1, at_limit).traversable, name


@pytest.mark.parametrize(
    ("status", "code", "word"),
    [
        (PoseStatus.OFF_MAP, "off_map", "map"),
        (PoseStatus.UNKNOWN_GROUND, "unknown_ground", "unknown"),
        (PoseStatus.NOT_SETTLED, "not_settled", "six wheels"),
        (PoseStatus.NO_EQUILIBRIUM, "no_equilibrium", "loads"),
    ],
)
def test_a_waypoint_without_a_pose_is_told_by_its_cause(fine, status, code, word):
    verdict = hold_against_limits(LSR1, with_status(fine, 1, status))
    assert (verdict.traversable, verdict.first_failure, verdict.code) == (False, 1, code)
    assert word in verdict.reason


def test_of_several_limits_the_first_along_the_path_and_then_of_the_codes_is_told(fine):
    later = with_value(with_value(fine, "belly_clearance", 1, 0.0), "tip_over_ratio", 4, 0.0)
    verdict = hold_against_limits(LSR1, later)
    assert (verdict.first_failure, verdict.code) == (1, "belly")
    assert verdict.codes == ("", "belly", "", "", "tip_over")
    broken = with_value(fine, "belly_clearance", 2, 0.0)
    broken = with_value(broken, "friction_utilisation", 2, 3.0, (0,))
    broken = with_value(broken, "tip_over_ratio", 2, 0.1)
    assert hold_against_limits(LSR1, broken).code == "tip_over"
    lifted = with_value(fine, "wheel_loads", 0, -1.0, (0,))
    lifted = with_value(lifted, "friction_utilisation", 0, np.inf, (0,))
    assert hold_against_limits(LSR1, lifted).code == "wheel_lift"


def test_margins_are_the_worst_along_the_settled_part(fine):
    changed = with_status(with_value(fine, "tip_over_ratio", 1, 0.7), 3, PoseStatus.NOT_SETTLED)
    changed = with_value(changed, "friction_utilisation", 2, 0.4, (3,))
    changed = with_value(changed, "torque_saturation", 2, 0.6, (1,))
    changed = with_value(changed, "belly_clearance", 0, 0.05)
    changed = with_value(changed, "pitch", 4, -0.2)
    verdict = hold_against_limits(LSR1, changed)
    assert verdict.min_tip_over_ratio == 0.7
    assert verdict.max_friction_utilisation == 0.4
    assert verdict.max_torque_saturation == 0.6
    assert verdict.min_belly_clearance == 0.05
    assert verdict.max_tilt == pytest.approx(0.2)


def test_a_verdict_is_json_with_none_for_what_is_not_finite(fine):
    broken = with_value(fine, "friction_utilisation", 2, np.inf, (3,))
    report = hold_against_limits(LSR1, broken).to_dict()
    back = json.loads(json.dumps(report, allow_nan=False))
    assert back == report
    assert back["code"] == "friction"
    assert back["max_friction_utilisation"] is None
    assert back["codes"] == ["", "", "friction", "", ""]


def test_the_reasons_of_many_waypoints_can_be_interrupted(fine):
    broken = fine.change(rocker_angle=np.full_like(fine.rocker_angle, 3.0))
    checks = []
    with interruptible(lambda: checks.append(1)):
        hold_against_limits(LSR1, broken)
    assert len(checks) >= len(POSES)
