"""Policy optimal: no torque set needs less friction, by linear programs of its own."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from support.best_torques import least_utilisation
from support.reference_cases import reference_ground
from support.rough_grounds import fractal, plane, random_poses, rocky, smooth

LSR1 = load_rover("lsr1")
few = settings(max_examples=20, deadline=None)


@pytest.mark.slow
@pytest.mark.parametrize("max_torque", [2.0, 0.4])
@pytest.mark.parametrize("make", [smooth, fractal, rocky])
def test_no_torques_within_the_limit_need_less_friction(make, max_torque):
    ground, poses = make(6), random_poses(6, 8, 0.6)
    prediction = sweep_path(
        LSR1, ground, poses, SweepOptions(policy="optimal", max_torque=max_torque)
    )
    compared = 0
    for i in np.flatnonzero(prediction.settled):
        bound = least_utilisation(LSR1, prediction, i, max_torque)
        if np.isinf(bound):
            continue
        compared += 1
        used = prediction.friction_utilisation[i].max()
        assert bound * (1.0 - 1e-6) <= used <= 1.005 * bound + 1e-4
        assert prediction.torque_saturation[i].max() <= 1.0 + 1e-9
    assert compared >= 4


@pytest.mark.slow
def test_on_the_steps_of_the_reference_no_torques_need_less_friction():
    case = reference_ground("settled_a/step")
    prediction = sweep_path(LSR1, case.terrain, case.poses, SweepOptions(policy="optimal"))
    for i in range(len(case.poses)):
        bound = least_utilisation(LSR1, prediction, i, LSR1.wheel.max_torque)
        used = prediction.friction_utilisation[i].max()
        assert bound * (1.0 - 1e-6) <= used <= 1.005 * bound + 1e-4


@few
@given(st.floats(0.05, 0.5), st.floats(-np.pi, np.pi))
def test_on_a_plane_the_least_friction_is_at_least_the_slope(slope, yaw):
    ground, pose = plane(slope, 0.0), [[0.0, 0.0, yaw]]
    optimal = sweep_path(LSR1, ground, pose, SweepOptions(policy="optimal", friction=1.0))
    assert optimal.friction_utilisation[0].max() >= slope * (1.0 - 1e-3)


@pytest.mark.parametrize("yaw", [0.0, np.pi])
@pytest.mark.parametrize("slope", [0.1, 0.3, 0.5])
def test_straight_up_or_down_a_plane_the_least_friction_is_the_slope(slope, yaw):
    optimal = sweep_path(
        LSR1, plane(slope, 0.0), [[0.0, 0.0, yaw]], SweepOptions(policy="optimal", friction=1.0)
    )
    assert optimal.friction_utilisation[0] == pytest.approx(np.full(6, slope), rel=2e-3)


def test_traction_control_passes_a_slope_that_equal_torques_do_not():
    ground, pose = plane(0.45, 0.0), [[0.0, 0.0, 0.0]]
    assert (
        judge(LSR1, sweep_path(LSR1, ground, pose, SweepOptions(policy="equal"))).code
        == "friction"
    )
    assert judge(LSR1, sweep_path(LSR1, ground, pose, SweepOptions(policy="optimal"))).traversable


def test_neither_policy_passes_a_slope_steeper_than_friction():
    ground, pose = plane(0.45, 0.0), [[0.0, 0.0, 0.0]]
    for policy in ("equal", "optimal"):
        verdict = judge(
            LSR1, sweep_path(LSR1, ground, pose, SweepOptions(policy=policy, friction=0.4))
        )
        assert verdict.code == "friction", policy


def test_too_weak_motors_are_told_as_such_under_both_policies():
    ground, pose = plane(0.45, 0.0), [[0.0, 0.0, 0.0]]
    for policy in ("equal", "optimal"):
        arguments = {"policy": policy, "friction": 5.0, "max_torque": 0.3}
        assert (
            judge(LSR1, sweep_path(LSR1, ground, pose, SweepOptions(**arguments))).code == "torque"
        ), policy


@few
@given(st.integers(0, 19))
def test_optimal_torques_never_use_more_friction_than_equal_ones(seed):
    ground, poses = rocky(seed), random_poses(seed, 20, 1.8)
    equal = sweep_path(LSR1, ground, poses, SweepOptions(policy="equal"))
    optimal = sweep_path(LSR1, ground, poses, SweepOptions(policy="optimal"))
    within = (equal.torque_saturation.max(axis=1) <= 1.0) & (equal.wheel_loads.min(axis=1) > 0.0)
    most, least = (p.friction_utilisation.max(axis=1)[within] for p in (equal, optimal))
    assert within.any()
    assert (least <= most * (1.0 + 1e-4) + 1e-6).all()


def test_the_policy_changes_nothing_about_where_the_rover_is():
    ground, poses = rocky(4), random_poses(4, 30, 1.8)
    equal = sweep_path(LSR1, ground, poses, SweepOptions(policy="equal"))
    optimal = sweep_path(LSR1, ground, poses, SweepOptions(policy="optimal"))
    for name in ("status", "position", "roll", "pitch", "wheel_centres", "tip_over_ratio"):
        assert getattr(equal, name).tobytes() == getattr(optimal, name).tobytes(), name
    assert not np.array_equal(equal.torque, optimal.torque)
