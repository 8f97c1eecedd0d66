"""Joint states of several publishers are merged by name; each joint has a time of its own."""

import pytest

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_planner.traction.input_monitor import NEVER
from rover_planner.traction.joint_memory import JointMemory

ANGLES = dict.fromkeys(SUSPENSION_JOINTS, 0.1)
RATES = dict.fromkeys(WHEEL_JOINTS, 0.2)


def test_wheels_and_suspension_may_come_in_messages_of_their_own():
    memory = JointMemory()
    assert memory.is_empty and memory.time == NEVER
    assert memory.take(ANGLES, {}, 1.0)
    assert memory.describe_older(0.5) == f"no velocity of {', '.join(WHEEL_JOINTS)}"
    assert memory.take({}, RATES, 1.1)
    assert memory.time == 1.0 and memory.wheel_time == 1.1
    assert memory.suspension_angles == pytest.approx([0.1] * 4)
    assert memory.wheel_rates == pytest.approx([0.2] * 6)


def test_joints_of_an_arm_change_nothing():
    memory = JointMemory()
    memory.take(ANGLES, RATES, 1.0)
    assert not memory.take({"arm_yaw": 1.0}, {"arm_yaw": 0.1}, 2.0)
    assert memory.time == 1.0


def test_a_wheel_that_is_missing_from_messages_gets_old_by_itself():
    memory = JointMemory()
    memory.take(ANGLES, RATES, 1.0)
    rest = {name: rate for name, rate in RATES.items() if name != "rear_left_wheel"}
    memory.take(ANGLES, rest, 1.1)
    assert memory.time == memory.wheel_time == 1.0
    assert memory.describe_older(1.05) == "no velocity of rear_left_wheel"


def test_values_with_a_stamp_that_does_not_advance_are_not_taken():
    memory = JointMemory()
    assert memory.take(ANGLES, RATES, 1.0, stamp=5)
    for stamp in (5, 4):
        assert not memory.take(ANGLES, RATES, 2.0, stamp=stamp)
    assert memory.time == 1.0
    assert memory.take(ANGLES, {}, 2.0, stamp=6) and memory.wheel_time == 1.0
    assert memory.take(ANGLES, RATES, 2.1) and not memory.take(ANGLES, RATES, 2.2, stamp=5)
    memory.forget()
    assert memory.time == NEVER
    assert memory.take(ANGLES, RATES, 3.0, stamp=2)


def test_rates_of_the_suspension_are_known_only_while_all_are_recent():
    memory = JointMemory()
    memory.take(ANGLES, RATES | dict.fromkeys(SUSPENSION_JOINTS, 0.3), 1.0)
    assert memory.find_suspension_rates(0.9) == pytest.approx([0.3] * 4)
    memory.take({}, {"rocker_left": 0.4}, 1.2)
    assert memory.find_suspension_rates(1.1) is None
