# SPDX-License-Identifier: Apache-2.0
"""cmd_vel is heard in the type that a parameter names; another type is named."""

import pytest
from geometry_msgs.msg import Twist

from rover_planner.ros import subscriptions
from support.ros_fixtures import RosRun
from support.waiting import wait_until


@pytest.fixture
def other_context():
    """Return a participant of its own: one participant refuses two types on a topic."""
    run = RosRun()
    yield run
    run.close()


def test_cmd_vel_without_a_stamp_is_driven_where_the_parameter_says_so(
    other_context, start_rover, start_controller
):
    rover = start_rover(other_context, Twist)
    start_controller(cmd_vel_stamped=False)
    rover.wait_until_driven()


def test_cmd_vel_of_another_type_is_named_with_the_parameter(
    other_context, start_rover, start_controller, capfd, monkeypatch
):
    monkeypatch.setattr(subscriptions, "PERIOD", 0.5)
    start_controller()
    rover = start_rover(other_context, Twist)
    text = "cmd_vel of /rover is not heard: its type is geometry_msgs/msg/Twist; "
    text += "set parameter cmd_vel_stamped to false"

    def is_shown():
        return any(text in item.value for item in rover.status.values)

    wait_until(is_shown, "the warning in the diagnostics")
    # The rover may discover the controller's log after the warning, so the terminal counts.
    assert capfd.readouterr().err.count(text) == 1
