# SPDX-License-Identifier: Apache-2.0
"""A rover whose watch is lost stops: the processes of the launch file, killed while it drives."""

import subprocess
import time

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String

from rover_physics import save_terrain
from rover_planner.ros.qos import latched_qos, sensor_qos
from support.grounds import make_terrain, waves
from support.project.launch_files import simulation_commands
from support.ros_fixtures import domain_id, hear
from support.waiting import wait_until

LONGEST = 0.5
"""Time from the loss of the watch to a controller that drives no more [s]."""


@pytest.fixture
def processes(tmp_path, monkeypatch):
    """Start the processes of simulation.launch.py, and end them; return them by name."""
    file = tmp_path / "waves.npz"
    save_terrain(file, make_terrain(waves, half=5.0))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id()))
    commands = simulation_commands(terrain_file=str(file))
    started = {name: subprocess.Popen(words) for name, words in commands.items()}
    yield started
    for process in started.values():
        process.kill()
        process.wait()


def start_drive(planner) -> None:
    """Ask for a path of 3 m, and let the rover drive it."""
    planner.wait_for_server()
    planner.wait_for_pose(lambda pose: True, 30.0)
    answer = planner.ask((0.0, 0.0, 0.0), (3.0, 0.0, 0.0))
    assert answer["traversable"], answer["reason"]
    planner.send_path(np.array(answer["poses"]))


@pytest.mark.long
def test_the_rover_stops_within_half_a_second_of_the_loss_of_the_server(ros, processes, planner):
    ear = ros.spin(Node("ear", context=ros.context))
    states = hear(ear, String, "traction_controller/state", latched_qos())
    odometry = hear(ear, Odometry, "odometry", sensor_qos())

    def speed() -> float:
        return odometry[-1].twist.twist.linear.x

    def is_in(state: str) -> bool:
        return states[-1].data == state

    wait_until(lambda: states, "the controller", 120.0)
    assert is_in("fault")  # nothing was accepted yet
    start_drive(planner)
    wait_until(lambda: is_in("driving") and speed() > 0.02, "the drive", 60.0)
    processes["traverse_server"].kill()
    lost = time.monotonic()
    wait_until(lambda: is_in("fault"), "the stop")
    assert time.monotonic() - lost < LONGEST
    time.sleep(0.5)
    assert abs(speed()) < 1e-3  # held
    processes["traverse_server"] = subprocess.Popen(processes["traverse_server"].args)
    pose = planner.wait_for_pose(lambda pose: True, 1.0)
    time.sleep(2.0)
    assert is_in("fault")  # the new server has accepted no path
    assert planner.ask(pose, (3.0, 0.0, 0.0))["traversable"]  # asked before it has started
    wait_until(lambda: is_in("driving"), "the drive to go on")
