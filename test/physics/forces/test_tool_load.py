# SPDX-License-Identifier: Apache-2.0
"""Tool load: what force and moment at the arm's tip do to balance and tip-over measures.

That the balance holds with it is in test_equilibrium.py.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.errors import ModelError
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from support.rough_grounds import plane
from support.rover_geometry import attitude_of

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
ARM = LSR1.manipulator
LEVEL, POSE = plane(0.0, 0.0), [[0.0, 0.0, 0.0]]
AHEAD = {"arm_yaw": 0.0, "arm_shoulder": 0.0, "arm_elbow": 0.0}
ASIDE = AHEAD | {"arm_yaw": np.pi / 2}
vectors = st.tuples(*[st.floats(-8.0, 8.0)] * 3)
few = settings(max_examples=20)


def test_pushing_down_at_the_tip_the_wheels_carry_so_much_less():
    # What is pushed pushes back: 6 N up, 0.85 m ahead of the body's origin.
    free, push = (
        judge_path(LSR1, LEVEL, POSE, SweepOptions(joint_angles=AHEAD, tool_force=force))[0]
        for force in (None, [0.0, 0.0, 6.0])
    )
    assert push.wheel_loads.sum() == pytest.approx(LSR1.weight - 6.0)
    levers = push.contact_points[0] - push.position[0]
    pitching = levers[:, 0] @ (push.wheel_loads - free.wheel_loads)[0]
    assert pitching == pytest.approx(-0.85 * 6.0, abs=1e-9)


@few
@given(st.floats(0.05, 3.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_a_hanging_payload_is_as_its_weight_pulling_at_the_tip(payload, slope_x, slope_y):
    ground = plane(slope_x, slope_y)
    carried = judge_path(LSR1, ground, POSE, SweepOptions(joint_angles=ASIDE, payload=payload))[0]
    down = attitude_of(carried, 0).T @ np.array([0.0, 0.0, -payload * LSR1.gravity])
    pulled = judge_path(LSR1, ground, POSE, SweepOptions(joint_angles=ASIDE, tool_force=down))[0]
    for name in ("wheel_loads", "tangential", "lateral"):
        assert getattr(pulled, name) == pytest.approx(getattr(carried, name), abs=1e-7), name
    # The angles are about other centres of mass, but vanish together.
    assert (carried.tip_over_ratio[0] < 0.0) == (pulled.tip_over_ratio[0] < 0.0)


@few
@given(vectors, vectors)
def test_a_load_on_the_tool_is_as_one_of_equal_effect_elsewhere(force, moment):
    rover = replace(LSR1, manipulator=replace(ARM, link_masses=(0.0, 0.0, 0.0)))
    joints = {"arm_yaw": 0.4, "arm_shoulder": -0.5, "arm_elbow": 1.1}
    here = link_points(ARM, np.array(list(joints.values())))[3]
    there = link_points(ARM, np.array(ARM.stowed))[3]
    moved = np.array(moment) + np.cross(here - there, force)
    one, two = (
        judge_path(rover, plane(0.1, 0.1), POSE, options)[0]
        for options in (
            SweepOptions(joint_angles=joints, tool_force=force, tool_moment=moment),
            SweepOptions(tool_force=force, tool_moment=moved),
        )
    )
    for name in ("wheel_loads", "tangential", "lateral", "tip_over_ratio", "tip_over_force_angle"):
        assert getattr(one, name) == pytest.approx(getattr(two, name), abs=1e-9), name


@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("kind", ["tool_force", "tool_moment"])
def test_the_margin_is_gone_when_a_load_empties_one_side(kind, share):
    # The wheels stand 0.31 m from the middle, 0.30 m below the body's origin, the tip 0.15 above.
    tipping = share * LSR1.weight * 0.31
    load = [0.0, tipping / 0.45, 0.0] if kind == "tool_force" else [-tipping, 0.0, 0.0]
    options = SweepOptions(joint_angles=AHEAD, friction=50.0, **{kind: load})
    prediction = judge_path(LSR1, LEVEL, POSE, options)[0]
    right = prediction.wheel_loads[0, :3].sum()
    assert right == pytest.approx((LSR1.weight * 0.31 - tipping) / 0.62, abs=1e-4)
    assert (prediction.tip_over_ratio[0] > 0.0) == (right > 0.0) == (share < 1.0)
    assert (prediction.tip_over_force_angle[0] > 0.0) == (right > 0.0)
    if share > 1.0:
        assert hold_against_limits(LSR1, prediction).code == "tip_over"


@pytest.mark.parametrize("name", ["tool_force", "tool_moment"])
def test_a_load_without_an_arm_or_that_is_no_vector_is_refused_by_name(name):
    with pytest.raises(ModelError, match=f"{name}.*m2020.*no manipulator"):
        judge_path(M2020, LEVEL, POSE, SweepOptions(**{name: [0.0, 0.0, 1.0]}))[0]
    for value in ([0.0, np.nan, 0.0], [np.inf, 0, 0], [1.0, 2.0], 3.0, "up"):
        with pytest.raises(ModelError, match=rf"{name} is .* three .*numbers"):
            SweepOptions(**{name: value})
