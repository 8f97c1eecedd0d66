# SPDX-License-Identifier: Apache-2.0
"""Manipulator: where the arm is, and what arm, payload and tool load do to loads and margin."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, judge_path
from rover_physics.errors import ModelError
from rover_physics.rover.manipulator import arm_angles, body_mass_and_com, link_points
from rover_physics.traversability.verdict import hold_against_limits
from support.grounds import plane
from support.rovers import LSR1, M2020

ARM = LSR1.manipulator
STIFF = replace(LSR1, manipulator=replace(ARM, joint_limits=((-3.2, 3.2), (-1, 1), (0, 2.5))))
LEVEL, POSE = plane(0.0, 0.0), [[0.0, 0.0, 0.0]]


def pose_of(yaw=0.0, shoulder=0.0, elbow=0.0) -> dict[str, float]:
    return {"arm_yaw": yaw, "arm_shoulder": shoulder, "arm_elbow": elbow}


@pytest.mark.parametrize(
    ("joints", "tip"),
    [
        ([0.0, 0.0, 0.0], [0.85, 0.0, 0.15]),
        ([np.pi / 2, 0.0, 0.0], [0.25, 0.60, 0.15]),
        ([0.0, 0.0, np.pi / 2], [0.55, 0.0, -0.15]),
        ([0.0, -np.pi / 2, np.pi / 2], [0.55, 0.0, 0.45]),
    ],
)
def test_the_tip_is_where_plain_geometry_has_it(joints, tip):
    points = link_points(ARM, np.array(joints))
    assert points[1] == pytest.approx([0.25, 0.0, 0.15])
    assert points[3] == pytest.approx(tip)


def test_arm_and_payload_move_the_centre_of_mass_by_the_path_of_their_masses():
    mass, com = body_mass_and_com(LSR1)
    assert mass == LSR1.masses.body.mass
    assert com == pytest.approx(LSR1.masses.body.com, abs=1e-15)
    _, stretched = body_mass_and_com(LSR1, pose_of())
    _, raised = body_mass_and_com(LSR1, pose_of(shoulder=-np.pi / 2))
    upper, fore = ARM.link_masses[1:]
    moved = (upper * 0.15 + fore * 0.45) / 5.0
    assert stretched - raised == pytest.approx([moved, 0.0, -moved])
    mass, com = body_mass_and_com(LSR1, pose_of(), payload=1.0)
    assert mass == pytest.approx(6.0)
    assert com == pytest.approx((5.0 * stretched + np.array([0.85, 0.0, 0.15])) / 6.0)
    assert body_mass_and_com(M2020, {"arm_yaw": 1.0})[1] == pytest.approx(M2020.masses.body.com)
    loaded = replace(LSR1, manipulator=replace(ARM, payload=0.7))  # the file's, unless given
    assert body_mass_and_com(loaded)[0] == pytest.approx(5.7)
    assert body_mass_and_com(loaded, payload=0.0)[0] == pytest.approx(5.0)


def test_joints_not_given_stay_stowed_and_names_of_others_are_passed_over():
    assert arm_angles(ARM, {"arm_elbow": 1.0, "mast": 7.0}).tolist() == [3.14159, -0.20, 1.0]
    assert arm_angles(ARM, None).tolist() == list(ARM.stowed)


@pytest.mark.parametrize(
    ("rover", "held", "said"),
    [
        (LSR1, {"angles": {"arm_elbow": np.nan}}, "arm_elbow"),
        (STIFF, {"angles": {"arm_shoulder": 1.1}}, r"arm_shoulder.* 1\.1; .* within -1 to 1 rad"),
        (LSR1, {"payload": -0.1}, r"payload is .* 0 kg or more"),
        (LSR1, {"payload": np.nan}, r"payload is .* 0 kg or more"),
        (M2020, {"payload": 1.0}, "m2020.*no manipulator"),
    ],
)
def test_impossible_angles_and_payloads_are_refused_by_name(rover, held, said):
    with pytest.raises(ModelError, match=said):
        body_mass_and_com(rover, held.get("angles"), payload=held.get("payload"))


def test_a_file_with_a_payload_that_tips_the_rover_is_refused():
    heavy = replace(LSR1, manipulator=replace(ARM, stowed=(0.0, 0.0, 0.0), payload=20.0))
    with pytest.raises(ModelError, match="tips over on flat ground"):
        judge_path(heavy, LEVEL, POSE)


@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("kind", ["tool_force", "tool_moment"])
def test_the_margin_is_gone_when_a_load_empties_one_side(kind, share):
    # The wheels stand 0.31 m from the middle, 0.30 m below the body's origin, the tip 0.15 above.
    tipping = share * LSR1.weight * 0.31
    load = [0.0, tipping / 0.45, 0.0] if kind == "tool_force" else [-tipping, 0.0, 0.0]
    options = SweepOptions(joint_angles=pose_of(), friction=50.0, **{kind: load})
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
        judge_path(M2020, LEVEL, POSE, SweepOptions(**{name: [0.0, 0.0, 1.0]}))
    for value in ([0.0, np.nan, 0.0], [np.inf, 0, 0], [1.0, 2.0], 3.0, "up"):
        with pytest.raises(ModelError, match=rf"{name} is .* three .*numbers"):
            SweepOptions(**{name: value})
