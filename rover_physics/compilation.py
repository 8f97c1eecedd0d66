# SPDX-License-Identifier: Apache-2.0
"""Compiles kernels in processes of their own and loads what they have saved on disk.

A compilation holds Python's interpreter lock for seconds and takes some 400 MB. In another
process it holds nobody up, and several processes use several cores. Where nothing can be saved,
kernels compile in the process that needs them.

This module is also the program of these processes, `-m rover_physics.compilation NICENESS
FUNCTION...`: it calls functions, each named MODULE:NAME, and writes the index of each when it
begins.
"""

import gc
import importlib
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import rover_physics
from rover_physics.numerics.kernel_cache import KernelMissingError, can_save_kernels, loading_only

NICENESS = 19
"""Niceness of a process if nobody waits for what it compiles: the largest."""
Step = Callable[[], None]
"""Function at the top of a module that calls kernels once: they are loaded from disk, or
compiled."""
Report = Callable[[str], object]
"""Function that takes the name of a step that is compiled, when it begins."""


def load(step: Step) -> bool:
    """Load the kernels of a step; return False if one of them is not on disk."""
    try:
        with loading_only():
            step()
    except KernelMissingError:
        return False
    return True


class Compilation:
    """Loads the kernels of steps; what is not on disk is compiled by a process.

    It can be closed from another thread, or by an error such as KeyboardInterrupt in a `with`
    block; the process then ends at once.
    """

    def __init__(self, steps: Sequence[Step], niceness: int = 0):
        """Start nothing yet.

        Args:
            steps: What to compile, in this order.
            niceness: Added to that of this process.
        """
        self._steps, self._niceness = steps, niceness
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._process: subprocess.Popen[str] | None = None
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "Compilation":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, report: Report) -> None:
        """Load the kernels; it ends early if it is closed."""
        missing = [step for step in self._steps if not load(step)]
        if missing and can_save_kernels():
            self._compile(missing, report)
        for step in missing:
            if not self._closed.is_set():
                step()

    def start(self, report: Report, delay: float = 0.0) -> None:
        """Run in a thread after a delay [s], if it has not been started before."""

        def wait_and_run() -> None:
            if not self._closed.wait(delay):
                self.run(report)

        if self._thread is None:
            self._thread = threading.Thread(target=wait_and_run, daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the process and the thread if they still run."""
        with self._lock:
            self._closed.set()
            if self._process is not None:
                self._process.kill()
                self._process.wait()
        if self._thread is not None:
            self._thread.join()

    def _compile(self, steps: Sequence[Step], report: Report) -> None:
        """Compile steps in a process."""
        with self._lock:
            if self._closed.is_set():
                return
            self._process = start_process(steps, self._niceness)
        assert self._process.stdout is not None
        for line in self._process.stdout:
            report(steps[int(line)].__name__.replace("_", " "))
        self._process.wait()


def compile_groups(groups: Sequence[Sequence[Step]], report: Report, processes: int) -> None:
    """Load the kernels of groups; compile what is missing, each group in a process of its own.

    Args:
        groups: Steps; two groups should have few kernels in common.
        report: Called from threads.
        processes: Largest number of processes at the same time.
    """
    with ThreadPoolExecutor(processes) as pool, ExitStack() as compilations:
        started = [compilations.enter_context(Compilation(steps)) for steps in groups]
        for done in [pool.submit(one.run, report) for one in started]:
            done.result()


def start_process(steps: Sequence[Step], niceness: int) -> "subprocess.Popen[str]":
    """Start a process that runs steps and writes the index of each when it begins."""
    functions = [f"{step.__module__}:{step.__name__}" for step in steps]
    packages = [str(Path(rover_physics.__file__).parents[1]), *filter(None, sys.path)]
    return subprocess.Popen(
        [sys.executable, "-m", "rover_physics.compilation", str(niceness), *functions],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(packages)},
        stdin=subprocess.PIPE,  # it closes when this process ends, however it ends
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for this process, which then ends the other
        text=True,
    )


def main(niceness: str, *functions: str) -> None:
    """Call functions one after another; end when the process that started this one ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.nice(int(niceness))
    gc.disable()  # it would take a seventh of the time and save 120 MB of 420
    for index, function in enumerate(functions):
        print(index, flush=True)
        module, name = function.split(":")
        getattr(importlib.import_module(module), name)()


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main(*sys.argv[1:])
