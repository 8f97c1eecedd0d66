# SPDX-License-Identifier: Apache-2.0
"""Optimal torques and the ranges of torques, by linear programs of their own."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics import SweepOptions, find_torque_ranges, judge_path, judge_poses
from support.best_torques import INSIDE, can_stand, solve_forces
from support.grounds import (
    RESOLUTION,
    fractal,
    make_terrain,
    plane,
    random_poses,
    rocky,
    scaled_for,
    smooth,
)
from support.reference_cases import reference_ground
from support.rover_geometry import balance_matrix
from support.rovers import LSR1, M2020

STEP = reference_ground("settled_a/step")


@pytest.mark.parametrize("max_torque", [2.0, 0.4])
@pytest.mark.parametrize(
    ("ground", "poses"),
    [
        (smooth(6), random_poses(6, 4, 0.6)),
        (fractal(6), random_poses(6, 4, 0.6)),
        (rocky(6), random_poses(6, 4, 0.6)),
        (STEP.terrain, STEP.poses[::2]),
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
    assert compared >= 2


@pytest.mark.parametrize(("limit", "margin"), [(1.0, 0.2), (0.8, 0.0)])
def test_more_friction_refuses_no_pose(limit, margin):
    """Lateral forces need not be free where there is more of it."""
    rocks = rocky(11, half=1.2)
    banked = rocks.elevation + 0.4 * np.linspace(0.0, 2.4, len(rocks.elevation))[:, None]
    ground, poses = replace(rocks, elevation=banked), random_poses(11, 40, 0.6)
    rover = replace(LSR1, limits=replace(LSR1.limits, friction_utilisation=limit))
    passed = set()
    for friction in np.arange(0.4, 0.7, 0.02):
        options = SweepOptions("optimal", margin, friction=friction)
        codes = judge_poses(rover, ground, poses, options=options)[1].codes
        passes = {i for i, code in enumerate(codes) if not code}
        assert passed <= passes
        passed = passes
    assert passed


@pytest.mark.parametrize(
    ("soil", "slope"), [("dry_sand", 0.2), ("dry_sand", -0.4), ("lunar_nominal", -0.4)]
)
def test_no_torques_use_less_of_soil_than_the_best_ones(soil, slope):
    """Braking, too: the resistance of soil helps there."""
    ground, poses = plane(slope, 0.1), random_poses(6, 4, 0.1) * [1.0, 1.0, 0.2]
    options = SweepOptions("optimal", soil=soil, max_torque=20.0)
    prediction = judge_poses(LSR1, ground, poses, np.zeros(4), options)[0]
    for i, used in enumerate(prediction.friction_utilisation.max(axis=1)):
        assert can_stand(LSR1, prediction, i, used * (1.0 + 1e-6), 20.0)
        assert not can_stand(LSR1, prediction, i, 0.98 * used, 20.0)


def test_a_wheel_that_cannot_pull_itself_is_dragged_by_the_others():
    heavy, ground = replace(M2020, gravity=9.81), plane(0.0, 0.0, half=3.0)
    x, y = np.meshgrid(*[ground.origin[0] + RESOLUTION * np.arange(len(ground.elevation))] * 2)
    soft = replace(
        ground, soil=1 * ((x > 0.5) & (y > 0.5)), soil_names=("firm_ground", "mars_simulant")
    )
    equal, optimal = (
        judge_poses(heavy, soft, [[0.0, 0.0, 0.0]], [0.0], SweepOptions(policy))[0]
        for policy in ("equal", "optimal")
    )
    assert np.isinf(equal.friction_utilisation[0]).tolist() == [False] * 5 + [True]
    assert optimal.friction_utilisation.max() <= 1.0
    assert np.abs(optimal.tangential[0].sum()) <= 1e-6 * heavy.weight


def turn_on_a_bank(options):
    """Predict m2020 that turns on the spot, half of it on a bank across a side slope."""
    bank = make_terrain(lambda x, y: 0.2 * y + np.clip(0.5 * x, 0.0, 0.2) * (y > 0.0), 0.04, 1.6)
    ground, pose = scaled_for(M2020, bank, np.array([[0.4, 0.0, -1.178]]))
    return judge_poses(M2020, ground, pose, [np.inf], options)[0]


def test_forces_within_the_limits_are_found_where_equal_torques_lift_a_wheel():
    equal, optimal = (turn_on_a_bank(SweepOptions(policy)) for policy in ("equal", "optimal"))
    assert equal.wheel_loads.min() < 0.0
    limits = M2020.wheel.max_torque, INSIDE
    assert solve_forces(M2020, optimal, 0, np.zeros(12), *limits, shared=False).status == 0
    assert optimal.wheel_loads.min() > 0.0
    assert optimal.friction_utilisation.max() <= 1.0


@pytest.mark.parametrize("factor", [10.0, 1e3, 1e5])
def test_a_torque_limit_that_no_wheel_comes_near_does_not_matter(factor):
    """Equal torques lift a wheel there, so that the search starts far from the least friction."""
    within, far = (
        turn_on_a_bank(SweepOptions("optimal", max_torque=share * M2020.wheel.max_torque))
        for share in (1.0, factor)
    )
    assert within.torque_saturation.max() < 0.9
    least, found = within.friction_utilisation.max(), far.friction_utilisation.max()
    assert found == pytest.approx(least, rel=1e-3)


def range_by_program(prediction, i, wheel, max_torque, shared, share):
    """Return the range [N m] of a wheel's torque by linear programs, with a share of friction."""
    cost = np.eye(12)[6 + wheel]
    ends = [
        sign * solve_forces(LSR1, prediction, i, sign * cost, max_torque, share, shared).fun
        for sign in (1.0, -1.0)
    ]
    return LSR1.wheel.radius * LSR1.weight * np.array(ends)


@pytest.mark.parametrize(
    ("ground", "poses", "options", "shared"),
    [
        (rocky(5), random_poses(2, 2, 0.5), SweepOptions(friction=0.8, max_torque=0.8), True),
        (
            fractal(13, roughness=0.12),
            random_poses(13, 6, 1.8),
            SweepOptions("optimal", control_margin=0.4, friction=0.4, max_torque=2.0),
            False,
        ),
    ],
)
def test_ranges_lie_between_those_of_linear_programs_without_policy_and_margin(
    ground, poses, options, shared
):
    ranges, max_torque = find_torque_ranges(LSR1, ground, poses, options), options.max_torque
    physical = replace(options, policy="optimal", control_margin=0.0)
    optimal = judge_path(LSR1, ground, poses, physical)[0]
    compared, slack = 0, 1e-5 * max_torque
    for i in np.flatnonzero(ranges.feasible):
        along, S = balance_matrix(LSR1, optimal, i)[2][:, 1], optimal.lateral[i]
        left = S - np.polyval(np.polyfit(along, S, 1), along)
        if (np.abs(left).max() <= 1e-6 * LSR1.weight) != shared:
            continue
        for wheel in range(6):
            compared += 1
            widest, within = (
                range_by_program(optimal, i, wheel, max_torque, shared, share)
                for share in (1.0, INSIDE)
            )
            assert widest[0] - slack <= ranges.lowest[i, wheel] <= within[0] + slack
            assert within[1] - slack <= ranges.highest[i, wheel] <= widest[1] + slack
    assert compared >= 6


@settings(max_examples=10)
@given(st.integers(0, 1000), st.floats(-3.0, 3.0), st.sampled_from([None, "dry_sand"]))
def test_torques_that_a_policy_uses_are_within_the_ranges(seed, yaw, soil):
    ground, pose = smooth(seed), [[0.1, 0.2, yaw]]
    ranges = find_torque_ranges(LSR1, ground, pose, SweepOptions(soil=soil))
    for policy in ("equal", "optimal"):
        prediction, verdict = judge_path(LSR1, ground, pose, SweepOptions(policy, soil=soil))
        if verdict.code not in ("", "belly", "tilt"):
            continue
        assert ranges.feasible[0]
        assert (prediction.torque >= ranges.lowest - 1e-4).all()
        assert (prediction.torque <= ranges.highest + 1e-4).all()


def test_ranges_are_empty_where_no_torques_keep_the_constraints():
    poses = [[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]
    ranges = find_torque_ranges(LSR1, plane(0.45, 0.0), poses, SweepOptions(friction=0.4))
    assert not ranges.feasible.any()
    assert np.isnan(ranges.lowest).all() and np.isnan(ranges.highest).all()
