# SPDX-License-Identifier: Apache-2.0
"""Balance with turned wheels: any angles carry the weight, and no free force is lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.forces.equilibrium import FREE_FORCES, FREE_TORQUES, balance_forces
from rover_physics.prediction.evaluation import new_work
from rover_physics.rover.linkage import pack_linkage, place, place_masses
from rover_physics.rover.model import Rover, Steering
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path, judge_poses
from support.rough_grounds import plane, smooth

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
curvatures = st.one_of(st.floats(-20.0, 20.0), st.sampled_from([np.inf, -np.inf, 1 / 0.31]))
angles = st.lists(st.floats(-1.57, 1.57), min_size=6, max_size=6)
few = settings(max_examples=60)


def balance_of(rover: Rover, steering, roll: float = 0.0, pitch: float = 0.0):
    """Return WORK with the solved balance of a rover on a plane, and whether it was solved."""
    body = rover.masses.body
    linkage = pack_linkage(rover, body.mass, np.array(body.com))
    work, q = new_work(), np.array([0.0, roll, pitch, 0.0, 0.0, 0.0])
    work.placement.steering[:] = steering
    place(linkage, work.pose, q, work.placement)
    place_masses(linkage, q, work.placement)
    work.contacts.sine[:], work.contacts.cosine[:] = 0.0, 1.0
    work.contacts.point[:] = work.placement.centres - rover.wheel.radius * work.placement.up
    columns = 1 + FREE_FORCES
    return work, balance_forces(linkage, work.placement, work.contacts, columns, work.balance)


def sums_of(work, column: int) -> tuple[np.ndarray, float]:
    """Return sum and moment about the origin (6,) of a column of forces, and the largest force."""
    balance = work.balance
    forces = np.stack([balance.normal, balance.tangential, balance.lateral], axis=1)[..., column]
    on_wheels = np.einsum("wk,wkx->wx", forces, work.balance.frames)
    arms = work.contacts.point - work.placement.origin
    moments = np.cross(arms, on_wheels)
    return np.concatenate([on_wheels.sum(axis=0), moments.sum(axis=0)]), np.abs(forces).max()


@few
@given(angles, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.sampled_from([LSR1, M2020]))
def test_weight_is_carried_at_any_steering_angles_even_of_wheels_that_disagree(
    steering, roll, pitch, rover
):
    work, solved = balance_of(rover, steering, roll, pitch)
    if not solved:
        return
    assert sums_of(work, 0)[0][:3] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    for k in range(1, 1 + FREE_FORCES):
        sums, size = sums_of(work, k)
        assert np.abs(sums).max() <= 1e-9 * size


@few
@given(curvatures)
def test_all_lateral_forces_and_tractions_are_free_at_any_curvature(curvature):
    prediction = judge_poses(LSR1, smooth(1), [[0.1, 0.2, 0.3]], [curvature])[0]
    work, solved = balance_of(LSR1, prediction.steering_angle[0])
    assert solved
    common, free = work.balance.shares.common, work.balance.shares.free
    assert np.linalg.matrix_rank(work.balance.tangential[:, 1 : 1 + FREE_TORQUES]) == FREE_TORQUES
    every = np.column_stack([common[:, :2], np.eye(6)[:, free]])
    assert np.linalg.cond(every) <= 100.0


@pytest.mark.parametrize("turn", [1e-6, -1e-6])
def test_wheels_that_are_hardly_turned_share_as_straight_ones(turn):
    straight, _ = balance_of(LSR1, np.zeros(6), 0.1, 0.2)
    turned, _ = balance_of(LSR1, [-turn, 0.0, turn, -turn, 0.0, turn], 0.1, 0.2)
    for name in ("normal", "tangential", "lateral"):
        there, here = getattr(turned.balance, name)[:, 0], getattr(straight.balance, name)[:, 0]
        assert there == pytest.approx(here, abs=1e-5)


def test_in_a_crab_up_a_slope_the_tractions_carry_the_weight_along_it():
    crab = replace(LSR1, steering=Steering(("rear", "middle", "front"), np.pi / 2, 0.35))
    y = np.linspace(-0.2, 0.2, 9)
    poses = np.column_stack([0.0 * y, y, 0.0 * y])
    prediction = judge_path(crab, plane(0.0, np.tan(0.2)), poses)[0]
    assert prediction.steering_angle == pytest.approx(np.full((9, 6), np.pi / 2))
    expected = np.full((9, 6), LSR1.weight * np.sin(0.2) / 6.0)
    assert prediction.tangential == pytest.approx(expected, rel=1e-4)
    assert np.abs(prediction.lateral).max() <= 1e-3 * LSR1.weight
