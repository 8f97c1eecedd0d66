# SPDX-License-Identifier: Apache-2.0
"""Optional libraries, which only some commands need, and types that a robot may lack."""

import importlib.util
import platform
from functools import cache

from rover_planner.errors import PlanningError

INSTALL = {
    "rclpy": "ROS 2 Jazzy: source it, or pip install 'rover_planner[ros]'",
    "matplotlib": "matplotlib: pip install 'rover_planner[plots]'",
    "rosbags": "rosbags: pip install 'rover_planner[bags]'",
    "viser": "viser: pip install 'rover_planner[view]'",
    "distributed": "Dask: pip install 'rover_planner[survey]'",
    "zarr": "Zarr: pip install 'rover_planner[survey]'",
    "rasterio": "rasterio: pip install 'rover_planner[survey]'",
}
"""Name of each optional module's package, and how to install it."""

PLAIN = {
    name: name
    for name in ("clarabel", "numba", "numpy", "osqp", "pydantic", "rich", "scipy", "typer")
} | {"yaml": "PyYAML"}
"""Modules of a plain installation and their packages, which apt has not all."""


def need(module: str, what: str) -> None:
    """Raise PlanningError if `module`, a key of INSTALL that `what` needs, is missing."""
    if importlib.util.find_spec(module) is None:
        raise PlanningError(f"{what} needs {INSTALL[module]}")


def explain_import(error: ImportError, what: str) -> str:
    """Return in one line which library `what` needs that cannot be imported, and what helps.

    That is a library of ROS built for another Python, a part of ROS, or a plain requirement.
    """
    name = (error.name or "").partition(".")[0]
    if isinstance(error, ModuleNotFoundError) and name in PLAIN:
        return f"{what} needs {PLAIN[name]}, which is not installed: pip install {PLAIN[name]}"
    version = ".".join(platform.python_version_tuple()[:2])
    return (
        f"{what} needs {INSTALL['rclpy']}; this Python {version} cannot import "
        f"{error.name or 'a library of ROS'} ({error}). ROS from apt needs the system's Python "
        "or an environment made with --system-site-packages"
    )


@cache
def find_type(name: str) -> type | None:
    """Return a type such as grid_map_msgs.msg:GridMap; None where its package is missing."""
    module, _, kind = name.partition(":")
    try:
        found: type = getattr(importlib.import_module(module), kind)
    except ImportError:
        return None
    return found


def name_type(kind: type) -> str:
    """Return the name of a type of messages in ROS, such as geometry_msgs/msg/Twist."""
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
