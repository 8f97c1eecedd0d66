# SPDX-License-Identifier: Apache-2.0
"""Equilibrium and stability: balance, loads of MuJoCo, Figure 4, published check values."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics import PoseStatus, SweepOptions, judge_path, judge_poses
from rover_physics.forces.stability import tip_over_angles
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.rover.manipulator import link_points
from rover_physics.traversability.torque_ranges import evaluate_in_turn
from support.grounds import fractal, plane, random_poses, rocky, scaled_for, smooth
from support.reference_cases import STEERED, STRAIGHT, reference_predictions
from support.rover_geometry import (
    attitude_of,
    balance_residuals,
    balance_sums,
    place_rover,
    turned_round,
)
from support.rovers import LSR1, M2020

ROVERS = (LSR1, M2020, turned_round(LSR1), turned_round(M2020))
seeds = st.integers(0, 10_000)
vectors = st.tuples(*[st.floats(-8.0, 8.0)] * 3)
few = settings(max_examples=10)


# Against the reference


@pytest.mark.parametrize("files", [STRAIGHT, STEERED])
def test_the_forces_on_the_wheels_are_those_of_mujoco(files):
    errors = []
    for case, prediction in reference_predictions(files):
        parts = [prediction.wheel_loads, prediction.tangential, prediction.lateral]
        size = np.linalg.norm(parts, axis=0)
        errors.append(np.abs(size - np.linalg.norm(case.forces, axis=2)).ravel())
    errors = np.concatenate(errors) / LSR1.weight
    assert np.median(errors) <= 0.005
    if files == STRAIGHT:  # dropped on turned wheels, they hold one another
        assert errors.size == 81 * 6
        assert np.percentile(errors, 95) <= 0.015


# The balance


@given(
    rover=st.sampled_from(ROVERS),
    make=st.sampled_from([smooth, fractal, rocky]),
    seed=st.integers(0, 19),
    gravity=st.floats(1.0, 20.0),
    policy=st.sampled_from(["equal", "optimal"]),
    soil=st.sampled_from([None, "dry_sand"]),
    curvature=st.one_of(st.just(0.0), st.floats(-20.0, 20.0), st.sampled_from([np.inf, 1 / 0.31])),
)
def test_all_nine_balance_equations_hold_on_rough_ground(
    rover, make, seed, gravity, policy, soil, curvature
):
    rover = replace(rover, gravity=gravity)
    ground, poses = scaled_for(rover, make(seed), random_poses(seed, 6, 0.5))
    bends = np.full(6, curvature * LSR1.wheel.radius / rover.wheel.radius)
    options = SweepOptions(policy=policy, soil=soil)
    prediction = judge_poses(rover, ground, poses, bends, options)[0]
    assert not (prediction.status == PoseStatus.NO_EQUILIBRIUM).any()
    for i in np.flatnonzero(prediction.settled):
        assert np.abs(balance_residuals(rover, prediction, i)).max() <= 1e-9


@few
@given(seeds, st.floats(-np.pi, np.pi), vectors, vectors, st.sampled_from(["equal", "optimal"]))
def test_all_nine_balance_equations_hold_with_a_tool_load(seed, yaw, force, moment, policy):
    arm = replace(LSR1.manipulator, link_masses=(0.0, 0.0, 0.0))
    rover, joints = replace(LSR1, manipulator=arm), (0.4, -0.5, 1.1)
    options = SweepOptions(
        policy, joint_angles=dict(zip(arm.joints, joints, strict=True)),
        tool_force=force, tool_moment=moment,
    )  # fmt: skip
    prediction = judge_path(rover, smooth(seed), [[0.1, 0.2, yaw]], options)[0]
    placed, R = place_rover(rover, prediction, 0), attitude_of(prediction, 0)
    tip = placed.origin + R @ link_points(arm, np.array(joints))[3]
    acting = [(R @ np.array(force), tip, None, False)]
    # A couple: two opposite forces, a metre apart along each axis in turn.
    for k in range(3):
        pull = np.zeros(3)
        pull[(k + 2) % 3] = moment[k]
        lever = np.eye(3)[(k + 1) % 3]
        acting += [(R @ pull, tip + R @ lever, None, False), (-R @ pull, tip, None, False)]
    residuals = balance_residuals(LSR1, prediction, 0) + balance_sums(LSR1, placed, acting)
    assert np.abs(residuals).max() <= 1e-9


@few
@given(seeds)
def test_equal_torques_are_equal_and_lateral_forces_linear_along_the_rover(seed):
    prediction = judge_poses(LSR1, rocky(seed % 20), random_poses(seed, 3, 1.5), np.zeros(3))[0]
    for i in np.flatnonzero(prediction.settled):
        T, S = prediction.tangential[i], prediction.lateral[i]
        assert pytest.approx(np.full(6, T[0]), abs=1e-12 * LSR1.weight) == T
        ahead = attitude_of(prediction, i)[:, 0]
        along = (prediction.wheel_centres[i] - prediction.position[i]) @ ahead
        left = S - np.polyval(np.polyfit(along, S, 1), along)
        assert np.abs(left).max() <= 1e-9 * LSR1.weight


# Free forces: what torques change, and what no balance decides


@pytest.mark.parametrize(
    ("torques", "changes"),
    [([-0.2, 0.2, 0.0], [-0.733, 1.467, -0.733]), ([0.0, -0.2, 0.2], [0.0, 0.0, 0.0])],
)
def test_torques_change_loads_as_in_figure_4(torques, changes):
    model, ahead = pack_model(LSR1, plane(0.0, 0.0), SweepOptions("optimal")), np.zeros((1, 3))
    ((_, work),) = evaluate_in_turn(model, ahead, motions_of(model, ahead, None))
    balance, pulls = work.balance, np.array(torques * 2) / LSR1.wheel.radius
    relative = pulls[:5] - pulls[5]
    assert balance.tangential[:, 1:6] @ relative == pytest.approx(pulls, abs=1e-9)
    loads = balance.normal[:, 1:6] @ relative
    assert loads == pytest.approx(np.array(changes * 2), abs=0.0005)


def test_wheels_that_are_hardly_turned_share_as_straight_ones():
    poses = np.tile([0.1, 0.2, 0.3], (3, 1))
    found = judge_poses(LSR1, smooth(1), poses, [0.0, 1e-6, -1e-6])[0]
    for name in ("wheel_loads", "tangential", "lateral"):
        straight, *turned = getattr(found, name)
        assert turned == pytest.approx(np.array([straight] * 2), abs=1e-3 * LSR1.weight), name


# Stability

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
DOWN = np.array([0.0, 0.0, -9.81])
NONE = np.zeros(3)


def test_the_unit_square_has_the_check_value():
    angle, measure = tip_over_angles(SQUARE, np.array([0.5, 0.5, 1.0]), DOWN, NONE)
    assert angle == pytest.approx(0.46365, abs=5e-6)
    assert measure == pytest.approx(2.27419, abs=5e-6)


@few
@given(st.floats(-np.pi, np.pi), st.floats(0.2, 3.0))
def test_a_force_that_points_out_of_the_polygon_is_negative_by_both(direction, height):
    centre = np.array([0.5, 0.5, height])
    reach = 0.5 / max(abs(np.cos(direction)), abs(np.sin(direction)))
    aside = 9.81 * reach / height * np.array([np.cos(direction), np.sin(direction), 0.0])
    within = tip_over_angles(SQUARE, centre, DOWN + 0.98 * aside, NONE)
    beyond = tip_over_angles(SQUARE, centre, DOWN + 1.02 * aside, NONE)
    assert min(within) > 0.0
    assert max(beyond) < 0.0


def test_a_moment_that_turns_over_the_nearest_edge_takes_from_the_margin():
    centre = np.array([0.5, 0.3, 1.0])  # nearest to the edge y = 0; +x lifts the other side

    def angle(moment):
        return tip_over_angles(SQUARE, centre, DOWN, np.array([moment, 0.0, 0.0]))[0]

    tipping = 0.3 * 9.81
    assert angle(0.3 * tipping) < angle(0.0) < angle(-0.3 * tipping)
    assert angle(tipping) == pytest.approx(0.0, abs=1e-12)
    assert angle(1.01 * tipping) < 0.0 < angle(0.99 * tipping)
    turned = tip_over_angles(SQUARE, centre, DOWN, np.array([0.0, 0.0, 5.0]))
    assert turned[0] == pytest.approx(angle(0.0))  # a moment about the vertical tips nothing


@pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)
def test_on_flat_ground_both_measures_are_one(rover):
    prediction = judge_path(rover, plane(0.0, 0.0, half=3.0), [[0.1, 0, 0], [0, 0.2, 1.0]])[0]
    assert prediction.tip_over_ratio == pytest.approx([1.0, 1.0], abs=1e-9)
    assert prediction.tip_over_force_angle == pytest.approx([1.0, 1.0], abs=1e-9)
