"""Joint states are read by name, and angles without meaning are refused."""

import math

import pytest
from sensor_msgs.msg import JointState

from msg_adapters.errors import MessageError
from msg_adapters.joints import convert_steering, joint_positions
from rover_physics.names import STEERING_JOINTS
from rover_physics.rover.steering_joints import LEFT, RIGHT

WANTED = ("rocker_left", "bogie_left")


def test_positions_are_found_by_name_in_any_order():
    state = JointState(name=["bogie_left", "camera", "rocker_left"], position=[0.2, 9.0, 0.1])
    assert joint_positions(state, WANTED) == {"rocker_left": 0.1, "bogie_left": 0.2}


@pytest.mark.parametrize(
    "state",
    [
        JointState(),
        JointState(name=["rocker_left"]),
        JointState(name=["rocker_left"], velocity=[1.0], effort=[2.0]),
        JointState(name=["camera"], position=[1.0]),
    ],
)
def test_a_message_without_wanted_positions_says_nothing(state):
    assert joint_positions(state, WANTED) == {}


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_angle_that_is_not_finite_is_refused(value):
    state = JointState(name=["camera", "rocker_left"], position=[0.0, value])
    with pytest.raises(MessageError, match=r"position (nan|inf) of rocker_left"):
        joint_positions(state, WANTED)


def test_other_joints_are_not_looked_at():
    state = JointState(name=["camera", "camera", "rocker_left"], position=[math.nan, 0.0, 0.1])
    assert joint_positions(state, WANTED) == {"rocker_left": 0.1}


@pytest.mark.parametrize(
    ("names", "positions", "text"),
    [
        (["rocker_left", "bogie_left"], [0.1], "1 positions for 2 names"),
        ([], [0.1], "1 positions for 0 names"),
        (["rocker_left", "rocker_left"], [0.1, 0.2], "names rocker_left twice"),
    ],
)
def test_lengths_and_names_that_disagree_are_refused(names, positions, text):
    with pytest.raises(MessageError, match=text):
        joint_positions(JointState(name=names, position=positions), WANTED)


def test_steering_is_converted_to_positive_left_and_back_and_nothing_else_is():
    state = JointState(name=["front_left_steering", "rocker_left"], position=[0.3, 0.1])
    read = joint_positions(state, ("rocker_left", *STEERING_JOINTS))
    assert convert_steering(read, LEFT) == {"front_left_steering": 0.3, "rocker_left": 0.1}
    turned = convert_steering(read, RIGHT)
    assert turned == {"front_left_steering": -0.3, "rocker_left": 0.1}
    assert convert_steering(turned, RIGHT) == read
