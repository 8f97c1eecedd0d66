# SPDX-License-Identifier: Apache-2.0
"""Joints are read by name, with names, signs and offsets of the robot; odd ones are refused."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from msg_adapters.commands import joint_order
from msg_adapters.errors import MessageError
from msg_adapters.joints import OWN_NAMES, JointNames, read_joint_map
from msg_adapters.results.predictions import JOINTS, joint_trajectory
from rover_physics import judge_path
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.rover.steering_joints import RIGHT, steered_wheels, steering_joints
from support.grounds import make_terrain, waves
from support.paths import arc_of
from support.rovers import LSR1

WANTED = ("rocker_left", "bogie_left")


def test_positions_are_found_by_name_in_any_order_and_others_are_not_looked_at():
    state = JointState(name=["bogie_left", "camera", "camera", "rocker_left"])
    state.position = [0.2, math.nan, 9.0, 0.1]
    assert OWN_NAMES.positions(state, WANTED) == {"rocker_left": 0.1, "bogie_left": 0.2}
    state = JointState(name=["rocker_left"], velocity=[1.0], effort=[2.0])
    assert OWN_NAMES.positions(state, WANTED) == {}


@pytest.mark.parametrize(
    ("names", "positions", "text"),
    [
        (["rocker_left", "bogie_left"], [0.1], "1 positions for 2 names"),
        (["rocker_left", "rocker_left"], [0.1, 0.2], "names rocker_left twice"),
        (["rocker_left", "bogie_left"], [0.0, math.nan], "position nan of bogie_left"),
    ],
)
def test_joint_states_that_disagree_or_are_not_finite_are_refused(names, positions, text):
    with pytest.raises(MessageError, match=text):
        OWN_NAMES.positions(JointState(name=names, position=positions), WANTED)


def test_steering_is_converted_to_positive_left_and_back_and_nothing_else_is():
    state = JointState(name=["front_left_steering", "rocker_left"], position=[0.3, 0.1])
    names, wanted = JointNames(steering=RIGHT), ("rocker_left", *STEERING_JOINTS)
    read = OWN_NAMES.positions(state, wanted)
    assert read == {"front_left_steering": 0.3, "rocker_left": 0.1}
    turned = {"front_left_steering": -0.3, "rocker_left": 0.1}
    assert names.positions(state, wanted) == turned and names.turn(turned) == read
    mapped = read_joint_map(["front_left_steering:s:-1:0.1"], STEERING_JOINTS, RIGHT)
    state = JointState(name=["s"], position=[0.3])
    assert mapped.positions(state, wanted) == {"front_left_steering": pytest.approx(0.3 - 0.1)}


def test_angles_and_rates_are_those_of_the_model():
    names = read_joint_map(["rocker_left:rl:-1:0.1", "bogie_left: bl "], JOINTS)
    state = JointState(name=["rl", "bl", "rocker_right"])
    state.position, state.velocity = [0.3, 0.2, 0.5], [1.0, 2.0, 3.0]
    assert names.positions(state, SUSPENSION_JOINTS) == pytest.approx(
        {"rocker_left": -0.2, "bogie_left": 0.2, "rocker_right": 0.5}
    )
    assert names.velocities(state, SUSPENSION_JOINTS) == pytest.approx(
        {"rocker_left": -1.0, "bogie_left": 2.0, "rocker_right": 3.0}
    )
    assert OWN_NAMES.positions(state, SUSPENSION_JOINTS) == {"rocker_right": 0.5}
    swapped = ["rocker_left:rocker_right", "rocker_right:rocker_left"]
    assert read_joint_map(swapped, SUSPENSION_JOINTS).link("rocker_left").robot == "rocker_right"


def test_a_predicted_trajectory_is_read_back_as_the_model_has_it():
    entries = [f"{name}:{name}_j:-1:0.3" for name in SUSPENSION_JOINTS]
    entries += [f"{name}:{name}_j:-1" for name in WHEEL_JOINTS]
    names, joints = read_joint_map(entries, JOINTS, RIGHT), (*JOINTS, *steering_joints(LSR1))
    path = arc_of(1.0, np.linspace(0.0, 0.5, 30))
    prediction = judge_path(LSR1, make_terrain(waves), path)[0]
    own = joint_trajectory(prediction, LSR1, Header()).points[-1]
    theirs = joint_trajectory(prediction, LSR1, Header(), names=names)
    last = theirs.points[-1]
    state = JointState(name=theirs.joint_names, position=last.positions)
    state.velocity = last.velocities
    for back, right in (
        (names.positions(state, joints), own.positions),
        (names.velocities(state, joints), own.velocities),
    ):
        assert [back[name] for name in joints] == pytest.approx(list(right))
    np.testing.assert_array_equal(last.effort, -np.array(own.effort))
    steering = prediction.steering_angle[-1, steered_wheels(LSR1)]
    np.testing.assert_array_equal(own.positions[len(JOINTS) :], steering)
    assert last.positions[theirs.joint_names.index("front_left_steering")] < -0.3


def test_the_order_of_commands_is_given_in_names_of_the_robot_or_the_model():
    names = read_joint_map([f"{name}:j{k}" for k, name in enumerate(WHEEL_JOINTS)], JOINTS)
    assert joint_order(["j5", "j4", "j3", "j2", "j1", "j0"], names).tolist() == [5, 4, 3, 2, 1, 0]
    assert joint_order(WHEEL_JOINTS, names).tolist() == list(range(6))
    with pytest.raises(MessageError, match="j0, j1"):
        joint_order(["j5"], names)


@pytest.mark.parametrize(
    ("entries", "text"),
    [
        (["rocker_left"], "must be model_joint:robot_joint"),
        (["rockr:a"], "the model does not have"),
        (["rocker_left:a:2"], "must be 1 or -1"),
        (["rocker_left:a:x"], "no number"),
        (["rocker_left:a:1:nan"], "within 2 pi"),
        (["rocker_left:a", "rocker_left:b"], "rocker_left twice"),
        (["rocker_left:a", "rocker_right:a"], "a twice"),
        (["rocker_left:rocker_right"], "that of another"),
    ],
)
def test_a_wrong_entry_of_the_map_is_refused_with_the_reason(entries, text):
    with pytest.raises(MessageError, match=text):
        read_joint_map(entries, JOINTS)
