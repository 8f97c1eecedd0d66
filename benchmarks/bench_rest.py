# SPDX-License-Identifier: Apache-2.0
"""Measures the CPU time of programs while the rover stands, and of the learner in a drive."""

import os
import time
from collections.abc import Mapping
from pathlib import Path

from geometry_msgs.msg import TwistStamped
from rclpy.node import Node

from benchmarks.measure import Figure
from benchmarks.processes import CONTROLLER, SERVER, START_TIME, STOP_TIMEOUT, open_nodes
from rover_planner.demo.child_process import ChildProcess
from rover_planner.ros.qos import TOPIC_QOS
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.waiting import wait_until

SETTLING, SECONDS = 8.0, 30.0
"""Time before the measurement, and its length [s]."""
LEARNER = "ground_learner"
MOST = {"traverse_server": 3.0, "traction_controller": 8.0, "rover_simulator": 15.0, LEARNER: 5.0}
"""Aimed at, in percent of a core."""
SPEED, COMMAND_PERIOD = 0.06, 0.1
"""Speed of the drive [m/s], and the time between two commands [s]."""
SIMULATED = {
    "enabled_at_start": True, "stop_timeout": STOP_TIMEOUT,
    "joint_states_timeout": 0.2, "imu_timeout": 0.2, "watchdog_timeout": 0.2,
}  # fmt: skip
"""Parameters of the controller beside a simulator, as in the launch files."""
GROUND = make_mars_terrain(1, 24.0, 0.05, rock_cover=0.01)


def measure() -> list[Figure]:
    """Measure programs at rest, then the learner in a drive."""
    return [*_measure_rest(), _measure_learner()]


def _measure_rest() -> list[Figure]:
    with open_nodes() as nodes:
        found = {
            "rover_simulator": nodes.start(
                "rover_simulator", terrain_file=GROUND, follow_commands=True
            ),
            SERVER: nodes.start(SERVER, monitor=True),
            CONTROLLER: nodes.start(CONTROLLER, **SIMULATED),
        }
        graph = nodes.client().connect().node
        wait_until(lambda: set(found) <= set(graph.get_node_names()), "all programs", START_TIME)
        return _watch(found, "at rest")


def _measure_learner() -> Figure:
    with open_nodes() as nodes:
        start = {"start_x": -6.0, "start_y": 0.0, "follow_commands": False}
        nodes.start("rover_simulator", terrain_file=GROUND, **start)
        found = {LEARNER: nodes.start(LEARNER)}
        driver = Node("driver", context=nodes.ros.context)
        commands = driver.create_publisher(TwistStamped, "cmd_vel", TOPIC_QOS)

        def drive() -> None:
            command = TwistStamped()
            command.header.stamp = driver.get_clock().now().to_msg()
            command.twist.linear.x = SPEED
            commands.publish(command)

        wait_until(lambda: LEARNER in driver.get_node_names(), "the learner", START_TIME)
        driver.create_timer(COMMAND_PERIOD, drive)
        nodes.ros.spin(driver)
        return _watch(found, "in a drive")[0]


def _watch(found: Mapping[str, ChildProcess], when: str) -> list[Figure]:
    """Return the CPU time of programs."""
    time.sleep(SETTLING)
    before, begin = {name: cpu_time(one.pid) for name, one in found.items()}, time.monotonic()
    time.sleep(SECONDS)
    used = {name: cpu_time(one.pid) - before[name] for name, one in found.items()}
    taken = time.monotonic() - begin
    return [
        Figure("rest", f"{name}: CPU {when}", 100.0 * one / taken, "%", MOST[name], repeats=1)
        for name, one in used.items()
    ]


def cpu_time(pid: int) -> float:
    """Return the CPU time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
