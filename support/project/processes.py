# SPDX-License-Identifier: Apache-2.0
"""Processes of a test, known by a token that all of them inherit in their environment."""

import contextlib
import os
import signal
import uuid
from pathlib import Path

from support.waiting import wait_until

_NAME = "ROVER_PLANNER_TEST_RUN"


class ProcessToken:
    """A mark in the environment of a process and of all that it starts."""

    def __init__(self) -> None:
        self.environment = {_NAME: str(uuid.uuid4())}
        """Variables to add to the environment of the first process."""

    def find(self, module: str = "") -> list[int]:
        """Return the numbers of the processes that have a text in their command line."""
        found, mark = [], f"{_NAME}={self.environment[_NAME]}".encode()
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                is_marked = mark in (folder / "environ").read_bytes().split(b"\0")
                if is_marked and module.encode() in (folder / "cmdline").read_bytes():
                    found.append(int(folder.name))
        return found

    def wait_until_gone(self, seconds: float = 10.0) -> list[int]:
        """Wait until no process is left; return those that are left in the end."""
        with contextlib.suppress(AssertionError):
            wait_until(lambda: not self.find(), "the end of all processes", seconds)
        return self.find()

    def kill(self) -> None:
        """End whatever is left."""
        for number in self.find():
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
