# SPDX-License-Identifier: Apache-2.0
"""Policy optimal: no torque set needs less friction, by linear programs of its own."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from support.best_torques import can_stand
from support.reference_cases import reference_ground
from support.rough_grounds import fractal, plane, random_poses, rocky, smooth

LSR1 = load_rover("lsr1")
POSE = [[0.0, 0.0, 0.0]]
STEP = reference_ground("settled_a/step")
few = settings(max_examples=20)


@pytest.mark.parametrize("max_torque", [2.0, 0.4])
@pytest.mark.parametrize(
    ("ground", "poses"),
    [
        (smooth(6), random_poses(6, 8, 0.6)),
        (fractal(6), random_poses(6, 8, 0.6)),
        (rocky(6), random_poses(6, 8, 0.6)),
        (STEP.terrain, STEP.poses),
    ],
    ids=["smooth", "fractal", "rocky", "step"],
)
def test_no_torques_within_the_limit_need_less_friction(ground, poses, max_torque):
    options = SweepOptions(policy="optimal", max_torque=max_torque)
    prediction = judge_path(LSR1, ground, poses, options)[0]
    compared = 0
    for i in np.flatnonzero(prediction.settled):
        if not can_stand(LSR1, prediction, i, 20.0, max_torque):
            continue
        compared += 1
        used = prediction.friction_utilisation[i].max()
        assert can_stand(LSR1, prediction, i, used * (1.0 + 1e-6), max_torque)
        assert not can_stand(LSR1, prediction, i, (used - 1e-4) / 1.005, max_torque)
        assert prediction.torque_saturation[i].max() <= 1.0 + 1e-9
    assert compared >= 4


@pytest.mark.parametrize(
    ("limits", "equal", "optimal"),
    [
        ({}, "friction", ""),
        ({"friction": 0.4}, "friction", "friction"),
        ({"friction": 5.0, "max_torque": 0.3}, "torque", "torque"),
    ],
    ids=["passes with traction control", "steeper than friction", "motors too weak"],
)
def test_a_slope_is_judged_by_what_each_policy_needs(limits, equal, optimal):
    for policy, code in (("equal", equal), ("optimal", optimal)):
        prediction = judge_path(
            LSR1, plane(0.45, 0.0), POSE, SweepOptions(policy=policy, **limits)
        )[0]
        assert hold_against_limits(LSR1, prediction).code == code, policy


@few
@given(st.integers(0, 19), st.sampled_from([None, (-25.0, 0.0, 8.0)]))
def test_optimal_torques_never_use_more_friction_than_equal_ones(seed, tool_force):
    ground, poses = rocky(seed), random_poses(seed, 20, 1.8)
    equal, optimal = (
        judge_path(LSR1, ground, poses, SweepOptions(policy=policy, tool_force=tool_force))[0]
        for policy in ("equal", "optimal")
    )
    within = (equal.torque_saturation.max(axis=1) <= 1.0) & (equal.wheel_loads.min(axis=1) > 0.0)
    most, least = (p.friction_utilisation.max(axis=1)[within] for p in (equal, optimal))
    assert within.any()
    assert (least <= most * (1.0 + 1e-4) + 1e-6).all()


def test_neither_policy_nor_tool_load_moves_the_rover():
    ground, poses = rocky(4), random_poses(4, 30, 1.8)
    here, *others = (
        judge_path(LSR1, ground, poses, options)[0]
        for options in (
            SweepOptions(),
            SweepOptions(policy="optimal"),
            SweepOptions(tool_force=[5.0, -3.0, 9.0]),
        )
    )
    for there in others:
        for name in ("status", "position", "roll", "pitch", "wheel_centres"):
            assert getattr(here, name).tobytes() == getattr(there, name).tobytes(), name
        assert not np.array_equal(here.wheel_loads, there.wheel_loads)
