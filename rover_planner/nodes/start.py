# SPDX-License-Identifier: Apache-2.0
"""Starts the node programs; reports help and missing libraries before ROS is imported."""

import importlib
import signal
import sys
from functools import partial

from rover_planner.errors import PlanningError
from rover_planner.nodes.programs import HELP_WORDS, print_help
from rover_planner.shell.extras import explain_import, need
from rover_planner.shell.run_program import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_OK,
    end_with,
)


def _start(name: str, stopped: int = EXIT_OK) -> int:
    """Run a node program and return its exit code, `stopped` if it is told to stop at once."""
    if not set(HELP_WORDS).isdisjoint(sys.argv[1:]):
        print_help(name)
        return EXIT_OK
    for number in (signal.SIGINT, signal.SIGTERM):  # until the node has its own handlers
        signal.signal(number, signal.default_int_handler)
    try:
        need("rclpy", "the node")
        module = importlib.import_module(f"rover_planner.nodes.{name}")
    except PlanningError as error:
        return end_with(name, EXIT_BAD_INPUT, str(error))
    except ImportError as error:  # rclpy of another Python, or only a part of ROS
        return end_with(name, EXIT_BAD_INPUT, explain_import(error, "the node"))
    except KeyboardInterrupt:  # told to stop before it began
        return stopped
    return module.main()


start_traverse_server = partial(_start, "traverse_server")
start_traction_controller = partial(_start, "traction_controller")
start_rover_simulator = partial(_start, "rover_simulator")
start_ground_learner = partial(_start, "ground_learner")
start_mission_planner = partial(_start, "mission_planner", EXIT_INTERRUPTED)
