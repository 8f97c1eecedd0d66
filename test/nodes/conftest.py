# SPDX-License-Identifier: Apache-2.0
"""What tests of nodes share."""

import os
import signal
import subprocess
import sys

import pytest

from support.ros_fixtures import domain_id


@pytest.fixture(autouse=True)
def signal_handlers():
    """Take back the handlers of signals that a program sets which runs in the test's process."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.fixture
def make_planner(ros):
    """Return a function that makes a mission planner; the next test's would wait for its end."""
    from rover_planner.nodes.mission_planner import MissionPlanner

    planners = []

    def make(**given):
        planners.append(MissionPlanner(context=ros.context, **given))
        return planners[-1]

    yield make
    for planner in planners:
        planner.destroy_node()


@pytest.fixture
def planner(make_planner):
    """Return a mission planner."""
    return make_planner()


@pytest.fixture
def start_process():
    """Return a function that starts a node with parameters; what is left at the end is killed."""
    processes = []

    def start(name, *parameters, **options):
        arguments = [word for text in parameters for word in ("-p", text)]
        process = subprocess.Popen(
            [sys.executable, "-m", f"rover_planner.nodes.{name}", "--ros-args", *arguments],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain_id()), "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **options,
        )
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()
