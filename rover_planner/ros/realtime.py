# SPDX-License-Identifier: Apache-2.0
"""Sets the real-time priority of this process, and keeps the kernel from holding it up."""

import ctypes
import os
from pathlib import Path

THREADS = Path("/proc/self/task")
_PR_SET_THP_DISABLE = 41


def avoid_huge_pages() -> None:
    """Keep Linux from collecting the memory of this process into huge pages.

    Its thread khugepaged looks through the processes that want huge pages, as large NumPy arrays
    do. It keeps a processor for 5 to 6 ms at a time, and no real-time priority ends that.
    """
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_PR_SET_THP_DISABLE, 1, 0, 0, 0)


def take_priority(priority: int) -> str:
    """Set the real-time priority (SCHED_FIFO) of all threads of this process.

    Args:
        priority: 1 to 99 as in sched(7); 0 changes nothing.

    Returns:
        The reason why it was not granted, empty if it was granted.
    """
    if priority == 0:
        return ""
    try:
        for thread in THREADS.iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        return (
            f"realtime_priority {priority} is not granted ({error}); it needs CAP_SYS_NICE or an "
            "rtprio of that much in /etc/security/limits.conf"
        )
    return ""
