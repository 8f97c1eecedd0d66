# SPDX-License-Identifier: Apache-2.0
"""Starts ROS where no log file can be written, and says what a node has to do without a disk."""

import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rclpy

from rover_physics.numerics.kernel_cache import kernel_cache_note
from rover_planner.ros.realtime import avoid_huge_pages

NO_LOG_FILE = ["--ros-args", "--disable-external-lib-logs"]
"""Arguments that keep ROS from writing a log file, without which it does not start."""


def init_ros(words: Sequence[str] | None, **options: Any) -> None:
    """Initialise ROS; on a full or read-only disk without a log file.

    Args:
        words: Arguments of the program; None takes those of the process.
        options: Further arguments of `rclpy.init`.
    """
    avoid_huge_pages()
    arguments = sys.argv if words is None else list(words)
    rclpy.init(args=[*arguments, *(NO_LOG_FILE if log_fault() else [])], **options)


def warn_of_disk(logger: Any) -> None:
    """Log one warning for each thing that the disk did not take."""
    kernels, log = kernel_cache_note(), log_fault()
    if kernels:
        advice = "each start compiles for half a minute"
        logger.warning(f"kernels are not cached: {kernels}; {advice}")
    if log:
        logger.warning(f"no log file is written: {log}")


def log_fault() -> str:
    """Return why ROS could not write a log file, empty if it could."""
    folder = log_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"\n")
    except OSError as error:
        return f"{error.strerror or error}: {folder}"
    return ""


def log_folder() -> Path:
    """Return the folder of ROS's log files: ROS_LOG_DIR, else ROS_HOME/log, else ~/.ros/log."""
    told = os.environ.get("ROS_LOG_DIR")
    if told:
        return Path(told).expanduser()
    home = os.environ.get("ROS_HOME") or str(Path(os.environ.get("HOME") or "/", ".ros"))
    return Path(home).expanduser() / "log"
