"""Joints of messages get names, signs and offsets of the model, and those of outputs theirs."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from msg_adapters.commands import joint_order
from msg_adapters.errors import MessageError
from msg_adapters.joint_map import OWN_NAMES, read_joint_map
from msg_adapters.results.predictions import JOINTS, joint_trajectory
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.prediction.sweep import sweep_path
from rover_physics.rover.rover_file import load_rover
from support.grounds import make_terrain, waves

KNOWN = (*SUSPENSION_JOINTS, *WHEEL_JOINTS)


def test_angles_and_rates_are_those_of_the_model():
    names = read_joint_map(["rocker_left:rl:-1:0.1", "bogie_left: bl "], KNOWN)
    state = JointState(name=["rl", "bl", "rocker_right"])
    state.position, state.velocity = [0.3, 0.2, 0.5], [1.0, 2.0, 3.0]
    wanted = SUSPENSION_JOINTS
    assert names.positions(state, wanted) == pytest.approx(
        {"rocker_left": -0.2, "bogie_left": 0.2, "rocker_right": 0.5}
    )
    assert names.velocities(state, wanted) == pytest.approx(
        {"rocker_left": -1.0, "bogie_left": 2.0, "rocker_right": 3.0}
    )
    assert OWN_NAMES.positions(state, wanted) == {"rocker_right": 0.5}


def test_a_predicted_trajectory_is_read_back_as_the_model_has_it():
    entries = [f"{name}:{name}_j:-1:0.3" for name in SUSPENSION_JOINTS]
    entries += [f"{name}:{name}_j:-1" for name in WHEEL_JOINTS]
    names = read_joint_map(entries, KNOWN)
    rover = load_rover("lsr1")
    poses = [(0.1 * k, 0.0, 0.0) for k in range(5)]
    prediction = sweep_path(rover, make_terrain(waves), poses)
    ours = joint_trajectory(prediction, rover, "map", _stamp())
    theirs = joint_trajectory(prediction, rover, "map", _stamp(), names=names)
    state = JointState(name=theirs.joint_names)
    state.position, state.velocity = theirs.points[3].positions, theirs.points[3].velocities
    back = names.positions(state, JOINTS)
    assert [back[name] for name in JOINTS] == pytest.approx(list(ours.points[3].positions[:10]))
    rates = names.velocities(state, JOINTS)
    assert [rates[name] for name in JOINTS] == pytest.approx(list(ours.points[3].velocities[:10]))
    np.testing.assert_array_equal(
        np.array(theirs.points[3].effort[4:10]), -np.array(ours.points[3].effort[4:10])
    )


def test_the_order_of_commands_is_given_in_names_of_the_robot_or_the_model():
    names = read_joint_map([f"{name}:j{k}" for k, name in enumerate(WHEEL_JOINTS)], KNOWN)
    assert joint_order(["j5", "j4", "j3", "j2", "j1", "j0"], names).tolist() == [5, 4, 3, 2, 1, 0]
    assert joint_order(WHEEL_JOINTS, names).tolist() == list(range(6))
    with pytest.raises(MessageError, match="j0, j1"):
        joint_order(["j5"], names)


@pytest.mark.parametrize(
    ("entries", "text"),
    [
        (["rocker_left"], "must be model_joint:robot_joint"),
        (["rocker_left:a:-1:0:0"], "must be model_joint"),
        (["rocker_left:"], "must be model_joint"),
        (["rockr:a"], "the model does not have"),
        (["rocker_left:a:2"], "must be 1 or -1"),
        (["rocker_left:a:x"], "no number"),
        (["rocker_left:a:1:nan"], "within 2 pi"),
        (["rocker_left:a", "rocker_left:b"], "rocker_left twice"),
        (["rocker_left:a", "rocker_right:a"], "a twice"),
        (["rocker_left:rocker_right"], "that of another"),
    ],
)
def test_a_wrong_entry_is_refused_with_the_reason(entries, text):
    with pytest.raises(MessageError, match=text):
        read_joint_map(entries, KNOWN)


def test_two_joints_may_change_names():
    names = read_joint_map(
        ["rocker_left:rocker_right", "rocker_right:rocker_left"], SUSPENSION_JOINTS
    )
    assert names.link("rocker_left").robot == "rocker_right"


def _stamp():
    from builtin_interfaces.msg import Time

    return Time()
