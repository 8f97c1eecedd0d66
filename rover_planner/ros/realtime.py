"""Sets the real-time priority of this process, if the system grants it."""

import os
from pathlib import Path

THREADS = Path("/proc/self/task")


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
