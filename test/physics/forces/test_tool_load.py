"""Tool load: what force and moment at the arm's tip do to balance and tip-over measures."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.errors import ModelError
from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.manipulator import link_points
from rover_physics.rover.rover_file import load_rover
from support.rough_grounds import mirrored, plane, smooth
from support.rover_geometry import attitude_of, balance_residuals, balance_sums, place_rover

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
ARM = LSR1.manipulator
LEVEL, POSE = plane(0.0, 0.0), [[0.0, 0.0, 0.0]]
SWAP = [3, 4, 5, 0, 1, 2]
AHEAD = {"arm_yaw": 0.0, "arm_shoulder": 0.0, "arm_elbow": 0.0}
ASIDE = AHEAD | {"arm_yaw": np.pi / 2}
TIP_AHEAD = np.array([0.85, 0.0, 0.15])
component = st.floats(-8.0, 8.0)
vectors = st.tuples(component, component, component)
few = settings(max_examples=20, deadline=None)


def support_moment(prediction) -> np.ndarray:
    """Return the moment (3,) about the body origin of vertical loads on level ground."""
    levers = prediction.contact_points[0] - prediction.position[0]
    forces = np.zeros((6, 3))
    forces[:, 2] = prediction.wheel_loads[0]
    return np.cross(levers, forces).sum(axis=0)


def test_pushing_down_at_the_tip_the_wheels_carry_so_much_less():
    # What is pushed pushes back: 6 N up, 0.85 m ahead of the body's origin.
    free = sweep_path(LSR1, LEVEL, POSE, SweepOptions(joint_angles=AHEAD))
    push = sweep_path(
        LSR1, LEVEL, POSE, SweepOptions(joint_angles=AHEAD, tool_force=[0.0, 0.0, 6.0])
    )
    assert push.wheel_loads.sum() == pytest.approx(LSR1.weight - 6.0)
    change = support_moment(push) - support_moment(free)
    assert change == pytest.approx([0.0, 0.85 * 6.0, 0.0], abs=1e-9)
    assert push.wheel_loads[0, 2] < free.wheel_loads[0, 2] - 1.0
    assert push.wheel_loads[0, 0] > free.wheel_loads[0, 0] + 1.0


def test_a_pull_ahead_is_taken_by_the_wheels_together():
    pull = sweep_path(
        LSR1, LEVEL, POSE, SweepOptions(joint_angles=AHEAD, tool_force=[6.0, 0.0, 0.0])
    )
    assert pull.tangential[0] == pytest.approx(np.full(6, -1.0))
    assert pull.wheel_loads.sum() == pytest.approx(LSR1.weight)


def test_a_push_from_the_side_is_taken_by_the_lateral_forces():
    push = sweep_path(
        LSR1, LEVEL, POSE, SweepOptions(joint_angles=AHEAD, tool_force=[0.0, 3.0, 0.0])
    )
    assert push.lateral.sum() == pytest.approx(-3.0)
    levers = push.contact_points[0] - push.position[0]
    assert (levers[:, 0] * push.lateral[0]).sum() == pytest.approx(-3.0 * 0.85)


def test_a_moment_shifts_loads_but_not_their_sum():
    turned = sweep_path(LSR1, LEVEL, POSE, SweepOptions(tool_moment=[1.5, 0.0, 0.0]))
    free = sweep_path(LSR1, LEVEL, POSE)
    assert turned.wheel_loads.sum() == pytest.approx(LSR1.weight)
    change = support_moment(turned) - support_moment(free)
    assert change == pytest.approx([-1.5, 0.0, 0.0], abs=1e-9)


@few
@given(st.integers(0, 1000), st.floats(-3.0, 3.0), vectors, vectors)
def test_all_nine_balance_equations_hold_with_a_tool_load(seed, yaw, force, moment):
    prediction = sweep_path(
        LSR1, smooth(seed), [[0.1, 0.2, yaw]], SweepOptions(tool_force=force, tool_moment=moment)
    )
    placed, R = place_rover(LSR1, prediction, 0), attitude_of(prediction, 0)
    tip = placed.origin + R @ link_points(ARM, np.array(ARM.stowed))[3]
    acting = [(R @ np.array(force), tip, None, False)]
    # A couple: two opposite forces, a metre apart along each axis in turn.
    for k in range(3):
        pull = np.zeros(3)
        pull[(k + 2) % 3] = moment[k]
        arm = np.eye(3)[(k + 1) % 3]
        acting += [(R @ pull, tip + R @ arm, None, False), (-R @ pull, tip, None, False)]
    residuals = balance_residuals(LSR1, prediction, 0) + balance_sums(LSR1, placed, acting)
    assert np.abs(residuals).max() <= 1e-9


@few
@given(st.floats(0.05, 3.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_a_hanging_payload_is_as_its_weight_pulling_at_the_tip(payload, slope_x, slope_y):
    ground = plane(slope_x, slope_y)
    carried = sweep_path(LSR1, ground, POSE, SweepOptions(joint_angles=ASIDE, payload=payload))
    down = attitude_of(carried, 0).T @ np.array([0.0, 0.0, -payload * LSR1.gravity])
    pulled = sweep_path(LSR1, ground, POSE, SweepOptions(joint_angles=ASIDE, tool_force=down))
    for name in ("wheel_loads", "tangential", "lateral"):
        assert getattr(pulled, name) == pytest.approx(getattr(carried, name), abs=1e-7), name
    # The angles are about other centres of mass, but vanish together.
    assert (carried.tip_over_ratio[0] < 0.0) == (pulled.tip_over_ratio[0] < 0.0)


@few
@given(vectors, vectors)
def test_a_load_on_the_tool_is_as_one_of_equal_effect_elsewhere(force, moment):
    other = replace(LSR1, manipulator=replace(ARM, link_masses=(0.0, 0.0, 0.0)))
    joints = {"arm_yaw": 0.4, "arm_shoulder": -0.5, "arm_elbow": 1.1}
    here = link_points(ARM, np.array(list(joints.values())))[3]
    there = link_points(ARM, np.array(ARM.stowed))[3]
    moved = np.array(moment) + np.cross(here - there, force)
    ground = plane(0.1, 0.1)
    one = sweep_path(
        other,
        ground,
        POSE,
        SweepOptions(joint_angles=joints, tool_force=force, tool_moment=moment),
    )
    two = sweep_path(other, ground, POSE, SweepOptions(tool_force=force, tool_moment=moved))
    for name in ("wheel_loads", "tangential", "lateral", "tip_over_ratio", "tip_over_force_angle"):
        assert getattr(one, name) == pytest.approx(getattr(two, name), abs=1e-9), name


@few
@given(vectors, vectors, st.floats(-0.2, 0.2))
def test_a_mirrored_load_swaps_right_and_left(force, moment, slope):
    ground, poses = plane(0.1, slope), np.array(POSE)
    here = sweep_path(
        LSR1, ground, poses, SweepOptions(joint_angles=AHEAD, tool_force=force, tool_moment=moment)
    )
    there = sweep_path(
        LSR1,
        *mirrored(ground, poses),
        options=SweepOptions(
            joint_angles=AHEAD,
            tool_force=np.array(force) * [1.0, -1.0, 1.0],
            tool_moment=np.array(moment) * [-1.0, 1.0, -1.0],
        ),
    )
    assert there.wheel_loads == pytest.approx(here.wheel_loads[:, SWAP], abs=1e-3)
    assert there.tangential == pytest.approx(here.tangential[:, SWAP], abs=1e-3)
    assert there.lateral == pytest.approx(-here.lateral[:, SWAP], abs=1e-3)
    assert there.tip_over_ratio == pytest.approx(here.tip_over_ratio, abs=1e-3)


# Tip-over


def test_the_margin_falls_as_a_payload_is_held_further_out_to_the_side():
    bends = (0.7, 0.5, 0.3, 0.0)  # the tip stays as high as the shoulder
    central = replace(LSR1, manipulator=replace(ARM, base=(0.0, 0.0, 0.05)))
    arms = [ASIDE | {"arm_shoulder": -bend, "arm_elbow": 2.0 * bend} for bend in bends]
    out = [
        sweep_path(central, LEVEL, POSE, SweepOptions(joint_angles=arm, payload=3.0))
        for arm in arms
    ]
    ratios = [prediction.tip_over_ratio[0] for prediction in out]
    assert ratios == sorted(ratios, reverse=True)
    assert ratios[0] > ratios[-1] + 0.05


def test_the_rover_of_the_file_has_all_its_margin_on_level_ground():
    rest = sweep_path(LSR1, LEVEL, POSE)
    assert rest.tip_over_ratio[0] == pytest.approx(1.0)
    assert rest.tip_over_force_angle[0] == pytest.approx(1.0)
    carried = sweep_path(LSR1, LEVEL, POSE, SweepOptions(joint_angles=ASIDE, payload=1.0))
    assert carried.tip_over_ratio[0] < 0.95


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_the_margin_is_gone_when_a_sideways_force_empties_one_side(share):
    # The wheels stand 0.31 m from the middle, 0.30 m below the body's origin.
    height = TIP_AHEAD[2] + 0.30
    force = share * LSR1.weight * 0.31 / height
    prediction = sweep_path(
        LSR1,
        LEVEL,
        POSE,
        SweepOptions(joint_angles=AHEAD, tool_force=[0.0, force, 0.0], friction=50.0),
    )
    right = prediction.wheel_loads[0, :3].sum()
    assert right == pytest.approx((LSR1.weight * 0.31 - force * height) / 0.62, abs=1e-4)
    assert (prediction.tip_over_ratio[0] > 0.0) == (right > 0.0)
    assert (prediction.tip_over_force_angle[0] > 0.0) == (right > 0.0)


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_the_margin_is_gone_when_a_moment_empties_one_side(share):
    moment = [-share * LSR1.weight * 0.31, 0.0, 0.0]
    prediction = sweep_path(LSR1, LEVEL, POSE, SweepOptions(tool_moment=moment))
    assert (prediction.wheel_loads[0, :3].sum() > 0.0) == (share < 1.0)
    assert (prediction.tip_over_ratio[0] > 0.0) == (share < 1.0)
    assert (judge(LSR1, prediction).code == "tip_over") or share < 1.0


# Policies, invariants


def test_no_load_is_as_a_load_of_zero():
    ground = plane(0.2, 0.1)
    for policy in ("equal", "optimal"):
        without = sweep_path(LSR1, ground, POSE, SweepOptions(policy=policy))
        zero = sweep_path(
            LSR1,
            ground,
            POSE,
            SweepOptions(policy=policy, tool_force=np.zeros(3), tool_moment=np.zeros(3)),
        )
        assert without.wheel_loads.tobytes() == zero.wheel_loads.tobytes()
        assert without.tip_over_ratio.tobytes() == zero.tip_over_ratio.tobytes()


def test_optimal_torques_hold_a_push_with_less_friction_than_equal_ones():
    load = {"joint_angles": AHEAD, "tool_force": [-25.0, 0.0, 8.0]}
    equal = sweep_path(LSR1, LEVEL, POSE, SweepOptions(policy="equal", **load))
    optimal = sweep_path(LSR1, LEVEL, POSE, SweepOptions(policy="optimal", **load))
    most, least = (p.friction_utilisation[0].max() for p in (equal, optimal))
    assert least < most - 0.05
    assert optimal.tangential.sum() == pytest.approx(25.0)


def test_the_load_does_not_move_the_rover():
    ground = smooth(3)
    here = sweep_path(LSR1, ground, POSE)
    there = sweep_path(LSR1, ground, POSE, SweepOptions(tool_force=[5.0, -3.0, 9.0]))
    assert here.wheel_centres.tobytes() == there.wheel_centres.tobytes()


def test_a_load_needs_an_arm():
    for name in ("tool_force", "tool_moment"):
        with pytest.raises(ModelError, match=f"{name}.*m2020.*no manipulator"):
            sweep_path(M2020, LEVEL, POSE, SweepOptions(**{name: [0.0, 0.0, 1.0]}))


@pytest.mark.parametrize("name", ["tool_force", "tool_moment"])
@pytest.mark.parametrize("value", [[0.0, np.nan, 0.0], [np.inf, 0, 0], [1.0, 2.0], 3.0, "up"])
def test_a_load_that_is_no_vector_is_refused_by_name(name, value):
    with pytest.raises(ModelError, match=rf"{name} is .* three .*numbers"):
        sweep_path(LSR1, LEVEL, POSE, SweepOptions(**{name: value}))
