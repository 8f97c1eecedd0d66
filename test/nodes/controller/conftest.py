# SPDX-License-Identifier: Apache-2.0
"""A rover that is driven by a controller, for the tests of this folder."""

import pytest
from rclpy.parameter import Parameter

from rover_planner.nodes.traction_controller import TractionController
from support.driven_rover import RATE, DrivenRover
from support.ros_fixtures import PATIENT
from support.waiting import wait_until


@pytest.fixture
def rover(ros):
    """Return a rover that sends everything that a controller needs."""
    rover = DrivenRover(ros.context)
    rover.send_twists()
    return ros.spin(rover)


@pytest.fixture
def start_controller(ros):
    """Return a function that starts an enabled, patient controller with other parameters."""

    def start(**values):
        values = {"rate": RATE, "enabled_at_start": True, **PATIENT} | values
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        return ros.spin(TractionController(context=ros.context, parameter_overrides=parameters))

    return start


@pytest.fixture
def controller(rover, start_controller):
    """Return a patient controller that drives the rover."""
    node = start_controller()
    wait_until(lambda: rover.state == "driving" and rover.push > 0.0, "driving")
    return node
