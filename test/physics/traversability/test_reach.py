# SPDX-License-Identifier: Apache-2.0
"""Reach: the arm's inverse kinematics, and the query whether the rover can reach and push."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_physics import SweepOptions, judge_path, judge_reach
from rover_physics.errors import ModelError
from rover_physics.rover.manipulator import arm_angles, inverse_kinematics, link_points
from support.grounds import plane, smooth
from support.rover_geometry import attitude_of
from support.rovers import LSR1, M2020

ARM = LSR1.manipulator
UNEQUAL = replace(ARM, link_lengths=(0.2, 0.5, 0.2))
NOT_NEAR = replace(ARM, link_lengths=(0.1, 0.4, 0.2))
LIMITED = replace(ARM, joint_limits=((-3.2, 3.2), (-1.0, 1.0), (0.0, 2.5)))
NARROW = replace(ARM, joint_limits=((-1.0, 1.0), (-3.0, 1.0), (-2.5, 2.5)))
LEVEL, POSE = plane(0.0, 0.0), [0.0, 0.0, 0.0]
HEIGHT = 0.30
places = st.floats(-1.0, 1.0)


# Inverse kinematics


@given(st.sampled_from([ARM, UNEQUAL]), places, places, places)
def test_the_tip_comes_to_every_point_within_reach_in_two_ways(arm, x, y, z):
    solutions = inverse_kinematics(arm, [x, y, z])
    shoulder = np.add(arm.base, [0.0, 0.0, arm.link_lengths[0]])
    distance = np.linalg.norm(np.subtract([x, y, z], shoulder))
    upper, fore = arm.link_lengths[1:]
    least, most = abs(upper - fore) - 1e-6, upper + fore + 1e-6
    assert len(solutions) == (2 if least <= distance <= most else 0)
    for angles in solutions:
        assert link_points(arm, angles)[3] == pytest.approx([x, y, z], abs=2e-6)
        assert (np.abs(angles) <= np.pi + 1e-12).all()


@given(st.tuples(*[st.floats(0.0, 1.0)] * 3))
def test_each_point_that_joints_within_their_limits_reach_is_reached_within_them(shares):
    low, high = np.transpose(NARROW.joint_limits)
    tip = link_points(NARROW, low + shares * (high - low))[3]
    solutions = inverse_kinematics(NARROW, tip)
    assert solutions
    for angles in solutions:
        assert link_points(NARROW, angles)[3] == pytest.approx(tip, abs=1e-6)
        arm_angles(NARROW, dict(zip(NARROW.joints, angles, strict=True)))


# The query


@given(st.integers(0, 1000), st.floats(-3.0, 3.0), st.floats(0.1, 0.5), st.floats(-1.0, 1.0))
def test_the_tip_is_at_the_target_in_the_map_frame(seed, yaw, away, side):
    ground = smooth(seed)
    standing = judge_path(LSR1, ground, [[0.1, 0.0, yaw]])[0]
    R, origin = attitude_of(standing, 0), standing.position[0]
    target = origin + R @ [0.3 + away * np.cos(side), away * np.sin(side), 0.2]
    answer = judge_reach(LSR1, ground, [0.1, 0.0, yaw], target)
    assert answer.reachable
    angles = arm_angles(ARM, answer.joint_angles)
    assert origin + R @ link_points(ARM, angles)[3] == pytest.approx(target, abs=1e-6)
    assert answer.target == pytest.approx(R.T @ (target - origin), abs=1e-9)


def test_of_two_ways_the_safer_one_is_chosen():
    # Far back and high: the elbow hanging low keeps the centre of mass lower.
    target = [0.55, 0.30, 0.45]
    answer = judge_reach(LSR1, LEVEL, POSE, target, SweepOptions(payload=0.5))
    margins = []
    for angles in inverse_kinematics(ARM, answer.target):
        joints = dict(zip(ARM.joints, angles, strict=True))
        held = judge_path(LSR1, LEVEL, [POSE], SweepOptions(joint_angles=joints, payload=0.5))[0]
        margins.append(held.tip_over_ratio[0])
    assert margins[0] != margins[1]
    assert answer.prediction.tip_over_ratio[0] == pytest.approx(max(margins))


@pytest.mark.parametrize(
    ("arm", "ahead", "up", "code", "out_of_reach", "words"),
    [
        (ARM, 0.75, 0.0, "too_far", 0.15, ["0.150 m out of reach", "reaches 0.600 m"]),
        (NOT_NEAR, 0.12, 0.0, "too_near", -0.08, ["0.080 m too near"]),
        (LIMITED, 0.0, 0.55, "joint_limits", 0.0, ["arm_shoulder at", "limits -1.00 to 1.00 rad"]),
    ],
)
def test_what_is_out_of_reach_says_why_and_by_how_much(arm, ahead, up, code, out_of_reach, words):
    rover, target = replace(LSR1, manipulator=arm), [0.25 + ahead, 0.0, 0.15 + HEIGHT + up]
    answer = judge_reach(rover, LEVEL, POSE, target)
    assert (answer.possible, answer.reachable, answer.code) == (False, False, code)
    assert answer.out_of_reach == pytest.approx(out_of_reach, abs=1e-4)
    assert all(word in answer.reason for word in words)
    assert answer.joint_angles is None and answer.verdict is None


@pytest.mark.parametrize(
    ("target", "options", "force", "codes"),
    [
        ([0.8, 0.0, 0.45], SweepOptions(payload=4.0), None, {"tip_over"}),
        ([0.7, 0.0, 0.1], SweepOptions(friction=0.3), [-30.0, 0.0, 0.0], {"friction"}),
        ([0.7, 0.0, 0.1], SweepOptions(friction=0.9), [-30.0, 0.0, 0.0], {""}),
        ([0.7, 0.0, 0.1], SweepOptions(), [0.0, 0.0, 60.0], {"tip_over", "wheel_lift"}),
    ],
)
def test_what_is_within_reach_may_be_too_much_to_hold_or_to_push(target, options, force, codes):
    answer = judge_reach(LSR1, LEVEL, POSE, target, options, force=force)
    assert answer.reachable and answer.code in codes
    assert answer.possible == (codes == {""})


def test_a_rover_without_an_arm_and_a_target_that_is_no_point_are_refused():
    with pytest.raises(ModelError, match="m2020.*no manipulator to reach with"):
        judge_reach(M2020, LEVEL, POSE, [0.5, 0.0, 0.0])
    for target in ([0.5, 0.0], [np.nan, 0.0, 0.0], "here"):
        with pytest.raises(ModelError, match="target is"):
            judge_reach(LSR1, LEVEL, POSE, target)
