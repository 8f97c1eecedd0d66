# SPDX-License-Identifier: Apache-2.0
"""Child processes that end with their parent; each has its own process group.

The program `python -m rover_planner.demo.child_process PARENT MODULE ...` runs a module that the
Linux kernel terminates when the process PARENT dies, even if that process was killed.
"""

import ctypes
import os
import runpy
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from rover_planner.shell.run_program import END_SIGNALS, end_as_by_ctrl_c

GRACE = 4.0
"""Time that a process has to end after SIGTERM before it is killed [s]."""

_PR_SET_PDEATHSIG = 1
_POLL = 0.05


class ChildProcess:
    """A Python module that runs in its own process group."""

    def __init__(
        self, module: str, arguments: Sequence[str], environment: Mapping[str, str], log: Path
    ):
        """Start the module; stderr is written to the file `log`, stdout is read by `lines`."""
        self.name = module.rpartition(".")[2]
        self.log = log
        with open(log, "wb") as log_file:
            self._process = subprocess.Popen(
                [sys.executable, "-m", __spec__.name, str(os.getpid()), module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log_file,
                env=dict(environment),
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """True if the process is still running."""
        return self.exit_code is None

    @property
    def exit_code(self) -> int | None:
        """Exit code, negative for a signal; None while the process is running.

        Asking does not reap the process, so that its number stays that of its group.
        """
        if self._process.returncode is not None:
            return self._process.returncode
        result = os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if result is None:
            return None
        return result.si_status if result.si_code == os.CLD_EXITED else -result.si_status

    def lines(self, watch: Callable[[], None]) -> Iterator[str]:
        """Yield the lines of standard output until it closes; call `watch` regularly meanwhile."""
        assert self._process.stdout is not None
        descriptor = self._process.stdout.fileno()
        pending = b""
        while True:
            watch()
            if not select.select([descriptor], [], [], 0.2)[0]:
                continue
            received = os.read(descriptor, 1 << 16)
            if not received:
                return
            *whole, pending = (pending + received).split(b"\n")
            yield from (line.decode(errors="replace") for line in whole)

    def last_line(self) -> str:
        """Return the last non-empty line of the log."""
        lines = self.log.read_text(errors="replace").splitlines()
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    def stop(self) -> None:
        """End the whole process group: send SIGTERM, wait for GRACE, then kill."""
        if self._process.returncode is not None:
            return
        self._signal(signal.SIGTERM)
        deadline = time.monotonic() + GRACE
        while self.running and time.monotonic() < deadline:
            time.sleep(_POLL)
        # the leader has not been reaped yet, so its id still belongs to this group
        self._signal(signal.SIGKILL)
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _signal(self, number: int) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)


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
