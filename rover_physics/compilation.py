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
from dataclasses import dataclass
from pathlib import Path

import rover_physics
from rover_physics.numerics.kernel_cache import KernelMissingError, can_save_kernels, loading_only

NICENESS = 19
"""Niceness of a process if nobody waits for what it compiles: the largest."""


@dataclass(frozen=True)
class CompilationStep:
    """Kernels that belong together, and how to get them."""

    name: str
    """Name of the kernels, for people."""
    function: str
    """MODULE:NAME of a function without arguments that calls the kernels once."""

    def run(self) -> None:
        """Call the kernels once: they are loaded from disk, or compiled."""
        _call(self.function)

    def load(self) -> bool:
        """Load the kernels; return False if one of them is not on disk."""
        try:
            with loading_only():
                self.run()
        except KernelMissingError:
            return False
        return True


def _call(function: str) -> None:
    module, name = function.split(":")
    getattr(importlib.import_module(module), name)()


class Compilation:
    """Loads the kernels of steps; what is not on disk is compiled by a process.

    It can be closed from another thread, or by an error such as KeyboardInterrupt in a `with`
    block; the process then ends at once.
    """

    def __init__(self, steps: Sequence[CompilationStep], niceness: int = 0):
        """Start nothing yet.

        Args:
            steps: What to compile, in this order.
            niceness: Added to that of this process.
        """
        self._steps, self._niceness = steps, niceness
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._closed = False

    def __enter__(self) -> "Compilation":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, report: Callable[[str], None]) -> bool:
        """Load the kernels and return True; False if it was closed before.

        Args:
            report: Function that takes the name of each step that is compiled, when it begins.
        """
        missing = [step for step in self._steps if not step.load()]
        if missing and can_save_kernels():
            self._compile(missing, report)
        for step in missing:
            if self._closed:
                return False
            step.run()
        return not self._closed

    def close(self) -> None:
        """End the process if it still runs."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()

    def _compile(self, steps: Sequence[CompilationStep], report: Callable[[str], None]) -> None:
        """Compile steps in a process."""
        with self._lock:
            if self._closed:
                return
            self._process = start_process([step.function for step in steps], self._niceness)
        assert self._process.stdout is not None
        for line in self._process.stdout:
            report(steps[int(line)].name)
        self._process.wait()


def compile_groups(
    groups: Sequence[Sequence[CompilationStep]], report: Callable[[str], None], processes: int
) -> None:
    """Load the kernels of groups; compile what is missing, each group in a process of its own.

    Args:
        groups: Steps; two groups should have few kernels in common.
        report: Function that takes the name of each step that is compiled; called from threads.
        processes: Largest number of processes at the same time.
    """
    with ThreadPoolExecutor(processes) as pool, ExitStack() as compilations:
        started = [compilations.enter_context(Compilation(steps)) for steps in groups]
        for done in [pool.submit(one.run, report) for one in started]:
            done.result()


class BackgroundCompilation:
    """Loads what is not needed yet, or compiles it in a process that gives way to all others."""

    def __init__(self, steps: Sequence[CompilationStep], done: Callable[[Sequence[str]], None]):
        """Start nothing yet.

        Args:
            steps: What to load.
            done: Function that takes the names of what was compiled, called from a thread.
        """
        self._compilation = Compilation(steps, NICENESS)
        self._done = done
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, delay: float = 0.0) -> None:
        """Begin after a delay [s], if it has not begun yet."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, args=(delay,), daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the process and the thread."""
        self._closed.set()
        self._compilation.close()
        if self._thread is not None:
            self._thread.join()

    def _run(self, delay: float) -> None:
        names: list[str] = []
        if not self._closed.wait(delay) and self._compilation.run(names.append):
            self._done(names)


def start_process(functions: Sequence[str], niceness: int) -> "subprocess.Popen[str]":
    """Start a process that calls functions and writes the index of each when it begins."""
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
        _call(function)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main(*sys.argv[1:])
