"""Child processes that never outlive their parent: a process group each, ended to the last member.

As a program, `python -m rover_planner.demo.child_process PARENT MODULE ...` runs a module that the
kernel (Linux) terminates when its parent has died, so that even a killed parent leaves nothing.
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
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

GRACE = 4.0
"""How long a process may take to end by itself after SIGTERM [s]."""

_PR_SET_PDEATHSIG = 1
_POLL = 0.05


class ChildProcess:
    """A Python module running in a process group of its own."""

    def __init__(
        self, module: str, arguments: Sequence[str], environment: Mapping[str, str], log: Path
    ):
        """Start the module; what it says on stderr goes to the log file, stdout can be read."""
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
        """Number of the process."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process has not ended yet."""
        return self._process.returncode is None and self._exit_status() is None

    @property
    def exit_code(self) -> int | None:
        """Exit code, negative for a signal; None while it is running."""
        if self._process.returncode is not None:
            return self._process.returncode
        return self._exit_status()

    def lines(self, watch: Callable[[], None]) -> Iterator[str]:
        """Yield the lines of its standard output until it closes; `watch` is called in between."""
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

    def last_words(self) -> str:
        """Return the last line of its log that says something."""
        lines = self.log.read_text(errors="replace").splitlines()
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    def stop(self) -> None:
        """End the whole group: ask, wait for GRACE, then kill."""
        if self._process.returncode is not None:
            return
        self._signal(signal.SIGTERM)
        deadline = time.monotonic() + GRACE
        while self.running and time.monotonic() < deadline:
            time.sleep(_POLL)
        # the leader is not waited for yet, so its number still names the group and nothing else
        self._signal(signal.SIGKILL)
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _signal(self, number: int) -> None:
        try:
            os.killpg(self._process.pid, number)
        except (ProcessLookupError, PermissionError):
            return

    def _exit_status(self) -> int | None:
        """Look whether the leader has ended, without reaping it."""
        flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
        result = os.waitid(os.P_PID, self._process.pid, flags)
        if result is None:
            return None
        return result.si_status if result.si_code == os.CLD_EXITED else -result.si_status


@contextmanager
def stopping_children() -> Iterator[list[ChildProcess]]:
    """Yield a list for child processes, all of which are stopped at the end, whatever happens.

    SIGTERM and SIGHUP end the block like Ctrl-C does, with the exit code that shells expect; while
    the children are being stopped further signals wait.
    """
    children: list[ChildProcess] = []
    numbers = (signal.SIGTERM, signal.SIGHUP)
    previous = {number: signal.signal(number, _exit_by_signal) for number in numbers}
    previous[signal.SIGINT] = signal.getsignal(signal.SIGINT)
    try:
        yield children
    finally:
        for number in previous:
            signal.signal(number, signal.SIG_IGN)
        for child in reversed(children):
            child.stop()
        for number, handler in previous.items():
            signal.signal(number, handler)


def _exit_by_signal(number: int, frame: FrameType | None) -> None:
    """Leave by way of all the finally blocks."""
    raise SystemExit(128 + number)


def _run_module() -> None:
    """Run the module named on the command line, bound to the life of the parent."""
    parent, module = int(sys.argv[1]), sys.argv[2]
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        raise SystemExit("the parent process has ended")
    sys.argv = sys.argv[2:]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _run_module()
