"""Precedence of this process over others on the machine, where the system grants it."""

import os
from pathlib import Path

THREADS = Path("/proc/self/task")


def take_priority(priority: int) -> str:
    """Let all threads of this process run before those of ordinary programs (SCHED_FIFO).

    Args:
        priority: 1 to 99 as in sched(7); 0 leaves everything as it is.

    Returns:
        Why it was not granted, empty where it was.
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
