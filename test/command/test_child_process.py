# SPDX-License-Identifier: Apache-2.0
"""Child processes end with their parent, however it ends, and take their own children along."""

import os
import signal
import subprocess
import sys

import pytest

from rover_planner.demo.child_process import ChildProcess, stopping_children
from support.project.checkout import TOP
from support.waiting import is_running, wait_until_gone

STUBBORN = """
import signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
inner = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(inner.pid, flush=True)
time.sleep(600)
"""
POLITE = """
import time
print("ready", flush=True)
time.sleep(600)
"""
PARENT = """
import os, sys, time
from pathlib import Path
from rover_planner.demo.child_process import ChildProcess, stopping_children
with stopping_children() as children:
    child = ChildProcess("polite", (), os.environ, Path(sys.argv[1]) / "log")
    children.append(child)
    child.stdout.readline()
    print(child.pid, flush=True)
    while True:  # a signal that comes just before a sleep does not end this sleep
        time.sleep(0.1)
"""


@pytest.fixture
def environment(tmp_path):
    (tmp_path / "stubborn.py").write_text(STUBBORN)
    (tmp_path / "polite.py").write_text(POLITE)
    (tmp_path / "failing.py").write_text("raise SystemExit('no luck today')")
    return os.environ | {"PYTHONPATH": f"{TOP}{os.pathsep}{tmp_path}"}


def test_a_child_that_ignores_sigterm_is_killed_with_its_own_child(
    tmp_path, environment, monkeypatch
):
    monkeypatch.setattr("rover_planner.demo.child_process.GRACE", 0.3)
    with stopping_children() as children:
        child = ChildProcess("stubborn", (), environment, tmp_path / "log")
        children.append(child)
        inner = int(child.stdout.readline())
        assert is_running(inner)
        assert child.poll() is None
    assert child.poll() == -signal.SIGKILL
    wait_until_gone(inner)


def test_a_failed_child_leaves_its_exit_code_and_last_words(tmp_path, environment):
    child = ChildProcess("failing", (), environment, tmp_path / "log")
    assert list(child.stdout) == []
    assert child.wait(60) == 1
    assert child.last_line() == "no luck today"
    child.stop()
    child.stop()


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGINT, -signal.SIGINT),
        (signal.SIGTERM, -signal.SIGINT),
        (signal.SIGKILL, -signal.SIGKILL),
    ],
)
def test_no_child_outlives_a_parent_that_is_signalled(tmp_path, environment, number, code):
    with subprocess.Popen(
        [sys.executable, "-c", PARENT, str(tmp_path)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as parent:
        child = int(parent.stdout.readline())
        assert is_running(child)
        parent.send_signal(number)
        try:
            assert parent.wait(60) == code
        finally:
            parent.kill()
    wait_until_gone(child)
