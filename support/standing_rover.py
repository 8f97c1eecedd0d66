# SPDX-License-Identifier: Apache-2.0
"""A rover that stands at the start of a path and hears stops, and a rock across its path."""

import time

from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import Bool

from rover_planner.ros.qos import latched_qos
from support.grounds import waves
from support.messages import odometry_at
from support.ros_fixtures import RosRun
from support.waiting import wait_until

START, GOAL = (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)


def rock_ahead(x, y):
    """Return waves with a rock of 0.4 m across the way from START to GOAL."""
    return waves(x, y) + 0.4 * ((abs(x - 1.2) < 0.15) & (abs(y) < 2.0))


class StandingRover(Node):
    """Publishes odometry at START, and hears ~/stop."""

    def __init__(self, ros: RosRun):
        super().__init__("rover", context=ros.context)
        self._odometry = self.create_publisher(Odometry, "odometry", 10)
        self.stops: list[tuple[bool, float]] = []
        """Each stop heard, and when [s]."""
        self.create_subscription(Bool, "/traverse_server/stop", self._hear, latched_qos())
        self.create_timer(0.05, lambda: self._odometry.publish(odometry_at(START)))

    def _hear(self, stop: Bool) -> None:
        self.stops.append((stop.data, time.monotonic()))

    @property
    def silence(self) -> float:
        """Time since the last stop was heard [s]."""
        return time.monotonic() - self.stops[-1][1]

    def wait_for_stop(self, value: bool = True) -> float:
        """Wait until the last stop has a value; return when that was heard [s]."""
        wait_until(lambda: self.stops and self.stops[-1][0] == value, f"stop {value}")
        return self.stops[-1][1]
