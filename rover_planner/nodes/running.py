# SPDX-License-Identifier: Apache-2.0
"""Runs a node as a program, from its arguments to a clean end on a signal.

ROS's own signal handlers end the context at once: open questions would stay without an answer, and
wheels without their zero torques. So signals are taken without ROS.
"""

import gc
import signal
import sys
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any

import rclpy
import rclpy.logging
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from rover_physics.errors import RoverError
from rover_planner.nodes.start import read_arguments
from rover_planner.ros.guard import GuardedExecutor
from rover_planner.ros.node import RoverNode
from rover_planner.ros.process import init_ros, take_priority, warn_of_disk
from rover_planner.shell.run_program import EXIT_BAD_INPUT, EXIT_OK

SIGNALS = (signal.SIGINT, signal.SIGTERM)
LOOK_FOR_STOP = 0.5
"""Longest time between two looks whether a node is to end [s]; a signal wakes it earlier."""


def run_node(
    name: str,
    kind: Callable[..., RoverNode[Any]],
    switch_interval: float | None = None,
    argv: Sequence[str] | None = None,
) -> int:
    """Run a node until it is stopped.

    Args:
        name: One of the PROGRAMS.
        kind: Its class.
        switch_interval: Longest time for which a thread may delay the executor's whenever that
            needs Python's lock [s]; None leaves Python's thread switch interval.
        argv: Its arguments; None takes those of the process.

    Returns:
        2 for a wrong argument or parameter, else 0.
    """
    node, stop, logger = None, StopSignals(), rclpy.logging.get_logger(name)
    try:
        options = read_arguments(name, argv)
        if options == EXIT_OK:  # help was printed
            return EXIT_OK
        init_ros(argv, signal_handler_options=SignalHandlerOptions.NO)
        executor = GuardedExecutor()
        given = [Parameter(one, value=value) for one, value in options.items()]
        node = kind(parameter_overrides=given)
        _take_priority(node)
        stop.defer(executor.wake)
        warn_of_disk(node.get_logger())
        executor.add_node(node)
        gc.collect()
        gc.freeze()  # objects that live as long as the node are excluded from garbage collection
        sys.setswitchinterval(switch_interval or sys.getswitchinterval())
        while not stop.wanted:
            executor.spin_once(timeout_sec=LOOK_FOR_STOP)
    except (RoverError, ParameterException) as error:  # ROS has parameters of its own
        logger.fatal(str(error))
        return EXIT_BAD_INPUT
    except (KeyboardInterrupt, ExternalShutdownException):
        return EXIT_OK
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return EXIT_OK


def _take_priority(node: RoverNode[Any]) -> None:
    """Set the real-time priority of a node's parameter; log a warning if it is not granted."""
    refusal = take_priority(getattr(node.values, "realtime_priority", 0), node.urgent_threads)
    if refusal:
        node.get_logger().warning(refusal)


class StopSignals:
    """Turns SIGINT and SIGTERM into KeyboardInterrupt while a node starts, then into a request.

    Only the first signal counts: launch and the terminal both send one, and the second may come
    when Python has ended so far that it would be killed by it.
    """

    def __init__(self) -> None:
        self.wanted = False
        """True once the node is to end."""
        self._wake: Callable[[], object] | None = None
        for number in SIGNALS:
            signal.signal(number, self._ask)

    def defer(self, wake: Callable[[], object]) -> None:
        """From now on a signal only sets `wanted` and calls `wake`."""
        self._wake = wake

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.wanted = True
        for one in SIGNALS:
            signal.signal(one, signal.SIG_IGN)
        if self._wake is None:
            raise KeyboardInterrupt
        self._wake()
