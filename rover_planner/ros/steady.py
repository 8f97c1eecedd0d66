# SPDX-License-Identifier: Apache-2.0
"""Timers that neither a step of the system clock nor a stopped /clock delays."""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer


def create_steady_timer(
    node: Node, period: float, do: Callable[[], object], *, starts: bool = True
) -> Timer:
    """Return a timer that calls a function each period [s], from now on or once it is reset."""
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    return node.create_timer(period, do, clock=steady, autostart=starts)
