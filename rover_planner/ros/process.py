# SPDX-License-Identifier: Apache-2.0
"""A node's process and the system: a log file, cached kernels, real-time priority."""

import contextlib
import ctypes
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rclpy
from rclpy.logging import get_logging_directory

from rover_physics.numerics.kernel_cache import kernel_cache_note

THREADS = Path("/proc/self/task")
PRECEDENCE = -10
"""Niceness of threads beside one with a real-time priority, which has to wait while one of them
holds Python's lock."""
_PR_SET_THP_DISABLE = 41
TRANSPORTS, PROFILES = "FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Variables of the environment that say by what Fast DDS talks."""
NO_LOG_FILE = ["--ros-args", "--disable-external-lib-logs"]
"""Arguments that keep ROS from writing a log file, without which it does not start."""


def init_ros(argv: Sequence[str] | None, **options: Any) -> None:
    """Initialise ROS; on a full or read-only disk without a log file.

    Args:
        argv: Arguments of the program; None takes those of the process.
        options: Further arguments of `rclpy.init`.
    """
    avoid_huge_pages()
    avoid_shared_memory()
    arguments = sys.argv if argv is None else list(argv)
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
    try:
        folder = get_logging_directory()
    except RuntimeError as error:  # there is no home
        return str(error)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"\n")
    except OSError as error:
        return f"{error.strerror or error}: {folder}"
    return ""


def avoid_huge_pages() -> None:
    """Keep Linux from collecting the memory of this process into huge pages.

    Its thread khugepaged looks through the processes that want huge pages, as large NumPy arrays
    do. It keeps a processor for 5 to 6 ms at a time, and no real-time priority ends that.
    """
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_PR_SET_THP_DISABLE, 1, 0, 0, 0)


def avoid_shared_memory() -> None:
    """Have Fast DDS talk by UDP alone, unless the environment says by what.

    Who publishes into shared memory waits for whoever holds the lock of its port. On a busy
    machine a process without real-time priority keeps that for 0.1 s and more.
    """
    if PROFILES not in os.environ:
        os.environ.setdefault(TRANSPORTS, "UDPv4")


def take_priority(priority: int, threads: Sequence[int] = ()) -> str:
    """Set the real-time priority (SCHED_FIFO) of threads of this process.

    Args:
        priority: 1 to 99 as in sched(7); 0 changes nothing.
        threads: Their ids; the others of now get PRECEDENCE. Empty takes all threads of now.

    Returns:
        The reason why it was not granted, empty if it was granted.
    """
    if priority == 0:
        return ""
    try:
        for thread in (int(entry.name) for entry in THREADS.iterdir()):
            with contextlib.suppress(ProcessLookupError):  # it has ended since it was listed
                if thread in threads or not threads:
                    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
                else:
                    os.setpriority(os.PRIO_PROCESS, thread, PRECEDENCE)
    except (OSError, AttributeError) as error:
        return (
            f"realtime_priority {priority} is not granted ({error}); it needs CAP_SYS_NICE or an "
            "rtprio of that much in /etc/security/limits.conf"
        )
    return ""
