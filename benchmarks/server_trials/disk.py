"""Servers on a disk that cannot be written, with nothing compiled."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.server_trials.stage import ROOT, START_TIME, server_environment
from support.project.without_disk import drop_rights, fill_disk, read_only

PACKAGES = ("rover_physics", "msg_adapters", "rover_planner", "config")


@dataclass(frozen=True)
class Start:
    """The start of a server."""

    time: float
    """Until it is ready [s]."""
    warnings: tuple[str, ...]
    """The warnings in its log."""


def start_read_only(folder: Path) -> Start:
    """Start a server from a copy whose folders cannot be written, with such a home."""
    copy = copy_packages(folder)
    with read_only(folder):
        return start(copy, folder, drop_rights)


def start_full(folder: Path) -> Start:
    """Start a server from a copy on a disk that is full."""
    return start(copy_packages(folder), folder, fill_disk)


def copy_packages(folder: Path) -> Path:
    """Copy the packages without compiled files; return the copy."""
    for name in PACKAGES:
        unwanted = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=unwanted)
    shutil.copy(ROOT / "package.xml", folder)  # by it the package knows a source checkout
    return folder


def start(checkout: Path, home: Path, prepare: Callable[[], None]) -> Start:
    """Start a server and end it when it is ready.

    Args:
        checkout: Folder of the packages.
        home: The user's home, with the folder of log files.
        prepare: Called in the new process before the server starts.
    """
    environment = {**os.environ, **server_environment(), "PYTHONPATH": str(checkout)}
    environment |= {"HOME": str(home), "ROS_LOG_DIR": str(home / "log")}
    environment.pop("NUMBA_CACHE_DIR", None)
    began, warnings = time.perf_counter(), []
    server = subprocess.Popen(
        [sys.executable, "-m", "rover_planner.nodes.traverse_server"],
        cwd=checkout,
        env=environment,
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
    )
    try:
        assert server.stderr is not None
        line = ""
        for line in server.stderr:
            warnings += [line.strip()] if "[WARN]" in line else []
            if "ready for rover" in line:
                return Start(time.perf_counter() - began, tuple(warnings))
            assert time.perf_counter() - began < START_TIME, "the server does not start"
        raise AssertionError(f"the server has ended with {server.wait()}: {line}")
    finally:
        server.terminate()
        server.wait(60.0)
