"""Libraries that only some commands need, and that a plain installation does not bring."""

import importlib.util

from rover_planner.errors import PlanningError

INSTALL = {
    "rclpy": "ROS 2 Jazzy: source it, or pip install 'rover_planner[ros]'",
    "matplotlib": "matplotlib: pip install 'rover_planner[plots]'",
    "viser": "viser: pip install 'rover_planner[view]'",
}
"""What a module belongs to, and how to get it."""


def need(module: str, what: str) -> None:
    """Raise PlanningError where a module of INSTALL is missing that `what` needs."""
    if importlib.util.find_spec(module) is None:
        raise PlanningError(f"{what} needs {INSTALL[module]}")
