# SPDX-License-Identifier: Apache-2.0
"""Waits of tests: for a condition, and for the end of a process."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

TIMEOUT = 20.0
"""Default limit of waits [s]; only a broken system takes that long."""


def wait_until(condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
    """Return the condition's first true value; fail with `what` after a timeout [s]."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.005)
    raise AssertionError(f"waited {timeout} s for {what}")


def repeat_until(act: Callable[[], Any], condition: Callable[[], Any], what: str) -> Any:
    """Act, such as publish what may be lost, until a condition holds; return its value."""
    return wait_until(lambda: (act(), condition())[1], what)


def is_running(pid: int) -> bool:
    """Tell whether a process is there and is more than an entry to be collected."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until_gone(pid: int, timeout: float = TIMEOUT) -> None:
    """Wait for the end of a process."""
    wait_until(lambda: not is_running(pid), f"the end of process {pid}", timeout)
