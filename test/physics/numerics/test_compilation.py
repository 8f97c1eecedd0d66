# SPDX-License-Identifier: Apache-2.0
"""Kernels compile in other processes, which end with the one that started them."""

import importlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rover_physics.compilation import Compilation, compile_groups
from support.project.checkout import TOP
from support.waiting import wait_until, wait_until_gone

MODULE = """
import os, sys, time
from pathlib import Path
from rover_physics.numerics.kernels import kernel

@kernel
def twice(x):
    return 2.0 * x

def first():
    twice(1.0)

def second():
    twice(1)

def third():
    raise AttributeError("third")

def endless():
    from rover_physics.numerics.kernel_cache import KernelMissingError
    if "compilation" not in sys.argv[0]:
        raise KernelMissingError
    Path(os.environ["PID_FILE"]).write_text(str(os.getpid()))
    while True:
        time.sleep(0.01)
"""
PARENT = """
from rover_physics.compilation import Compilation
import some_kernels

Compilation([some_kernels.endless]).run(print)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "some_kernels.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PID_FILE", str(tmp_path / "pid"))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{TOP}")
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    yield tmp_path
    sys.modules.pop("some_kernels", None)


def wait_for_process(folder: Path) -> int:
    file = folder / "pid"
    return int(wait_until(lambda: file.exists() and file.read_text(), "a process", 60.0))


def test_a_background_compilation_can_be_closed(folder):
    import some_kernels

    background = Compilation([some_kernels.endless])
    background.start(print)
    pid = wait_for_process(folder)
    background.close()
    wait_until_gone(pid)


def test_the_process_ends_with_its_parent_even_if_that_is_killed(folder):
    with subprocess.Popen([sys.executable, "-c", PARENT], stderr=subprocess.DEVNULL) as process:
        pid = wait_for_process(folder)
        process.send_signal(signal.SIGKILL)
        process.wait(60.0)
    wait_until_gone(pid)


@pytest.mark.long
def test_other_processes_compile_what_is_missing_this_one_loads_it_and_errors_are_raised(folder):
    for missing in (["first", "second"], []):
        made, names = importlib.import_module("some_kernels"), []
        compile_groups([[made.first], [made.second]], names.append, 2)
        assert sorted(names) == missing
        assert sum(made.twice.whole.stats.cache_hits.values()) == 2
        del sys.modules["some_kernels"]
    with pytest.raises(AttributeError, match="third"):
        compile_groups([[made.third], [made.first]], names.append, 2)
