# SPDX-License-Identifier: Apache-2.0
"""Equilibrium: the nine balance equations hold, loads are MuJoCo's, and Figure 4 of the paper."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.forces.equilibrium import balance_forces
from rover_physics.prediction.evaluation import new_work
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.linkage import pack_linkage, place, place_masses
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.model import Part, Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.traversability.judge import judge_path, judge_poses
from support.reference_cases import reference_grounds, reference_predictions
from support.rough_grounds import fractal, plane, random_poses, rocky, scaled_for, smooth
from support.rover_geometry import (
    attitude_of,
    balance_residuals,
    balance_sums,
    place_rover,
    turned_round,
)

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
ROVERS = (LSR1, M2020, turned_round(LSR1), turned_round(M2020))
seeds = st.integers(0, 10_000)
headings = st.floats(-np.pi, np.pi)
vectors = st.tuples(*[st.floats(-8.0, 8.0)] * 3)
few = settings(max_examples=10)


# Against the reference


def test_the_forces_on_the_wheels_are_those_of_mujoco():
    errors = []
    for case, prediction in reference_predictions():
        parts = [prediction.wheel_loads, prediction.tangential, prediction.lateral]
        size = np.linalg.norm(parts, axis=0)
        errors.append(np.abs(size - np.linalg.norm(case.forces, axis=2)).ravel())
    errors = np.concatenate(errors) / LSR1.weight
    assert errors.size == 81 * 6
    assert np.median(errors) <= 0.005
    assert np.percentile(errors, 95) <= 0.015


# The balance


@few
@given(headings, st.floats(0.5, 25.0), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_on_level_ground_the_loads_sum_to_the_weight(yaw, gravity, com_x, com_y):
    body = Part(LSR1.masses.body.mass, (com_x, com_y, 0.05))
    rover = replace(LSR1, gravity=gravity, masses=replace(LSR1.masses, body=body))
    prediction = judge_path(rover, plane(0.0, 0.0), [[0.0, 0.0, yaw]])[0]
    assert prediction.wheel_loads.sum() == pytest.approx(rover.weight, rel=1e-9)
    assert np.abs(prediction.tangential).max() <= 1e-9 * rover.weight
    assert np.abs(prediction.lateral).max() <= 1e-9 * rover.weight
    lever = prediction.contact_points[0] - prediction.position[0]
    across = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    share = body.mass * rover.gravity * com_y
    assert prediction.wheel_loads[0] @ (lever @ across) == pytest.approx(share, abs=1e-8)


@settings(max_examples=25)
@given(
    rover=st.sampled_from(ROVERS),
    make=st.sampled_from([smooth, fractal, rocky]),
    seed=st.integers(0, 19),
    gravity=st.floats(1.0, 20.0),
    policy=st.sampled_from(["equal", "optimal"]),
    curvature=st.one_of(st.just(0.0), st.floats(-20.0, 20.0), st.sampled_from([np.inf, 1 / 0.31])),
)
def test_all_nine_balance_equations_hold_on_rough_ground(
    rover, make, seed, gravity, policy, curvature
):
    rover = replace(rover, gravity=gravity)
    ground, poses = scaled_for(rover, make(seed), random_poses(seed, 6, 0.5))
    bends = np.full(6, curvature * LSR1.wheel.radius / rover.wheel.radius)
    prediction = judge_poses(rover, ground, poses, bends, SweepOptions(policy=policy))[0]
    assert not (prediction.status == PoseStatus.NO_EQUILIBRIUM).any()
    for i in np.flatnonzero(prediction.settled):
        assert np.abs(balance_residuals(rover, prediction, i)).max() <= 1e-9


@few
@given(seeds, headings, vectors, vectors)
def test_all_nine_balance_equations_hold_with_a_tool_load(seed, yaw, force, moment):
    prediction = judge_path(
        LSR1, smooth(seed), [[0.1, 0.2, yaw]], SweepOptions(tool_force=force, tool_moment=moment)
    )[0]
    placed, R = place_rover(LSR1, prediction, 0), attitude_of(prediction, 0)
    arm = LSR1.manipulator
    tip = placed.origin + R @ link_points(arm, np.array(arm.stowed))[3]
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


# Torque and friction


@pytest.mark.parametrize(("friction", "max_torque"), [(0.8, 2.0), (0.4, 1.0)])
def test_torque_is_traction_times_radius_and_both_utilisations_are_shares_of_their_limits(
    friction, max_torque
):
    for case in reference_grounds():
        options = SweepOptions(friction=friction, max_torque=max_torque)
        prediction = judge_path(LSR1, case.terrain, case.poses, options)[0]
        torque, shear = prediction.torque, np.hypot(prediction.tangential, prediction.lateral)
        assert torque == pytest.approx(0.1 * prediction.tangential, abs=1e-12)
        saturation = np.abs(torque) / max_torque
        assert prediction.torque_saturation == pytest.approx(saturation, abs=1e-12)
        carried = prediction.wheel_loads > 0.0
        expected = shear[carried] / (friction * prediction.wheel_loads[carried])
        assert prediction.friction_utilisation[carried] == pytest.approx(expected)
        assert np.isinf(prediction.friction_utilisation[~carried]).all()


def test_the_friction_of_the_ground_goes_before_that_of_the_rover():
    ground = plane(0.1, 0.0)
    friction = np.full(ground.elevation.shape, np.nan)
    friction[: friction.shape[0] // 2] = 0.25
    prediction = judge_path(LSR1, replace(ground, friction=friction), [[0.0, 0.0, 0.0]])[0]
    assert prediction.friction[0].tolist() == [0.25] * 3 + [0.8] * 3


# Figure 4


def load_changes(rover: Rover, torques: list[float]) -> np.ndarray:
    """Return how the loads (6,) [N] on flat ground change with torques on both sides.

    Args:
        rover: The rover.
        torques: Changes of the rear, middle and front torque [N m].
    """
    body = rover.masses.body
    linkage = pack_linkage(rover, body.mass, np.array(body.com))
    work, q = new_work(), np.zeros(6)
    place(linkage, work.pose, q, work.placement)
    place_masses(linkage, q, work.placement)
    work.contacts.sine[:], work.contacts.cosine[:] = 0.0, 1.0
    work.contacts.point[:] = work.placement.centres - [0.0, 0.0, rover.wheel.radius]
    assert balance_forces(linkage, work.placement, work.contacts, 6, work.balance)
    pulls = np.array(torques * 2) / rover.wheel.radius
    relative = pulls[:5] - pulls[5]
    assert work.balance.tangential[:, 1:6] @ relative == pytest.approx(pulls, abs=1e-9)
    return work.balance.normal[:, 1:6] @ relative


@pytest.mark.parametrize(
    ("torques", "changes"),
    [
        ([-0.2, 0.2, 0.0], [-0.733, 1.467, -0.733]),
        ([-0.2, 0.0, 0.2], [-0.733, 1.467, -0.733]),
        ([0.0, -0.2, 0.2], [0.0, 0.0, 0.0]),
    ],
)
def test_torques_change_loads_as_in_figure_4(torques, changes):
    loads = load_changes(LSR1, torques)
    assert loads == pytest.approx(np.array(changes * 2), abs=0.0005)
    assert loads.sum() == pytest.approx(0.0, abs=1e-9)
