# SPDX-License-Identifier: Apache-2.0
"""Inputs that cannot be used are named once, and a rover that they stop goes on by itself."""

import copy
import math

import pytest
from geometry_msgs.msg import Twist

from rover_planner.nodes.warm_up import JOINTS
from rover_planner.ros import subscriptions
from support.messages import set_field
from support.ros_fixtures import RosRun
from support.waiting import wait_until

CYCLES_IN_A_TENTH = 5


GOOD, NANS = "all inputs are right", [math.nan] * len(JOINTS)
OTHER_FRAME = "imu is in frame 'imu_link'; it must be in 'base_link', or the parameters"
SPOILS = [
    ("joints.velocity", NANS, "velocity nan of rocker_right"),
    ("imu.header.frame_id", "imu_link", OTHER_FRAME),
]


def test_what_cannot_be_used_stops_the_rover_is_said_once_and_passes_by_itself(
    ros, rover, controller
):
    for field, value, text in SPOILS:
        kept = copy.deepcopy(rover.joints), copy.deepcopy(rover.imu)
        set_field(rover, field, value)
        spoilt = rover.wait_for_send()
        wait_until(lambda: rover.state == "fault", "the fault")
        wait_until(lambda text=text: rover.count_lines(text), "the reason in the log")
        wait_until(lambda text=text: text in rover.status.message, "the diagnostics")
        assert rover.status.level == rover.status.ERROR
        assert sum(push > 0.0 for _, push in rover.commands_after(spoilt)) <= CYCLES_IN_A_TENTH
        told = len(rover.log)
        rover.joints, rover.imu = kept
        rover.wait_until_driven()
        wait_until(lambda told=told: GOOD in " ".join(rover.log[told:]), "the good news")
        assert rover.count_lines(text) == 1


def test_an_unforeseen_error_in_a_callback_is_a_fault_and_not_the_end(
    ros, rover, controller, monkeypatch
):
    def fail(*arguments):
        raise ZeroDivisionError("unforeseen")

    with monkeypatch.context() as patch:
        patch.setattr(controller.service, "take_attitude", fail)
        wait_until(lambda: rover.state == "fault", "the fault")
        wait_until(lambda: rover.count_lines("Traceback"), "the trace")
        text = "internal error: ZeroDivisionError: unforeseen"
        wait_until(lambda: text in rover.status.message, "the reason in the diagnostics")
        assert int(rover.values["internal_errors"]) > 0
    wait_until(lambda: rover.state == "driving", "driving")
    assert rover.count_lines("Traceback") == 1


def test_a_mounted_imu_is_turned_into_the_body_frame_and_steering_has_the_sign_of_the_rover(
    rover, start_controller
):
    rover.joints.position[JOINTS.index("front_left_steering")] = 0.2
    rover.imu.header.frame_id = "imu_link"
    rover.imu.orientation.w, rover.imu.orientation.z = 0.0, 1.0
    rover.imu.angular_velocity.x = 0.1
    node = start_controller(
        imu_frame="imu_link", imu_mounting=[0.0, 0.0, math.pi], steering_sign="right"
    )
    wait_until(lambda: rover.state == "driving", "driving")
    assert node.service._body_rates == pytest.approx([-0.1, 0.0, 0.0])
    assert node.service.steering[5] == -0.2


@pytest.fixture
def unstamped(start_rover):
    """Return a rover that sends Twist; in a context of its own, which refuses another type."""
    run = RosRun()
    yield start_rover(run, Twist)
    run.close()


def test_cmd_vel_without_a_stamp_is_driven_where_the_parameter_says_so(
    unstamped, start_controller
):
    start_controller(cmd_vel_stamped=False)
    unstamped.wait_until_driven()


def test_cmd_vel_of_another_type_is_named_with_the_parameter(
    unstamped, start_controller, capfd, monkeypatch
):
    monkeypatch.setattr(subscriptions, "PERIOD", 0.5)
    start_controller()
    text = "cmd_vel of /rover is not heard: its type is geometry_msgs/msg/Twist; "
    text += "set parameter cmd_vel_stamped to false"
    wait_until(lambda: text in str(unstamped.values), "the warning in the diagnostics")
    # The rover may discover the controller's log after the warning, so the terminal counts.
    assert capfd.readouterr().err.count(text) == 1
