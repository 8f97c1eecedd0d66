"""Checks for optional libraries, which only some commands need."""

import importlib.util

from rover_planner.errors import PlanningError

INSTALL = {
    "rclpy": "ROS 2 Jazzy: source it, or pip install 'rover_planner[ros]'",
    "matplotlib": "matplotlib: pip install 'rover_planner[plots]'",
    "viser": "viser: pip install 'rover_planner[view]'",
}
"""Name of each optional module's package, and how to install it."""


def need(module: str, what: str) -> None:
    """Raise PlanningError if `module`, a key of INSTALL that `what` needs, is missing."""
    if importlib.util.find_spec(module) is None:
        raise PlanningError(f"{what} needs {INSTALL[module]}")
