# SPDX-License-Identifier: Apache-2.0
"""Child processes that end with their parent; each has its own process group.

The program `python -m rover_planner.demo.child_process PARENT MODULE ...` runs a module that the
Linux kernel terminates when the process PARENT dies, even if that process was killed.
"""

import ctypes
import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from rover_planner.shell.run_program import END_SIGNALS, end_as_by_ctrl_c

GRACE = 4.0
"""Time that a process has to end after SIGTERM before it is killed [s]."""

_PR_SET_PDEATHSIG = 1


class ChildProcess(subprocess.Popen[str]):
    """A Python module that runs in its own process group."""

    def __init__(
        self, module: str, arguments: Sequence[str], environment: Mapping[str, str], log: Path
    ):
        """Start the module; stderr is written to the file `log`, stdout is a pipe."""
        self.name = module.rpartition(".")[2]
        self.log = log
        with open(log, "wb") as log_file:
            super().__init__(
                [sys.executable, "-m", __spec__.name, str(os.getpid()), module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log_file,
                env=dict(environment),
                start_new_session=True,
                text=True,
                errors="replace",
            )

    def last_line(self) -> str:
        """Return the last non-empty line of the log."""
        lines = self.log.read_text(errors="replace").splitlines()
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    def stop(self) -> None:
        """End the whole process group: send SIGTERM, wait for GRACE, then kill."""
        if self.poll() is None:
            for number, seconds in ((signal.SIGTERM, GRACE), (signal.SIGKILL, None)):
                with suppress(ProcessLookupError, PermissionError, subprocess.TimeoutExpired):
                    os.killpg(self.pid, number)
                    self.wait(seconds)
        if self.stdout is not None:
            self.stdout.close()


@contextmanager
def stopping_children() -> Iterator[list[ChildProcess]]:
    """Yield a list for child processes; all of them are stopped when the block ends.

    SIGTERM and SIGHUP end the block as Ctrl-C does. Further signals are blocked while the children
    are being stopped.
    """
    children: list[ChildProcess] = []
    with end_as_by_ctrl_c():
        try:
            yield children
        finally:
            numbers = (signal.SIGINT, *END_SIGNALS)
            previous = {number: signal.signal(number, signal.SIG_IGN) for number in numbers}
            for child in reversed(children):
                child.stop()
            for number, handler in previous.items():
                signal.signal(number, handler)


def _run_module() -> None:
    """Run the module named on the command line; it ends when the parent ends."""
    parent, module = int(sys.argv[1]), sys.argv[2]
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        raise SystemExit("the parent process has ended")
    sys.argv = sys.argv[2:]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _run_module()
