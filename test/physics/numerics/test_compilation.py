# SPDX-License-Identifier: Apache-2.0
"""Kernels compile in other processes, which end with the one that started them."""

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
PROGRAM = """
from rover_physics.compilation import Compilation
import some_kernels

steps = [some_kernels.first, some_kernels.second]
Compilation(steps).run(lambda name: print(name, end=" "))
print(sum(some_kernels.twice.whole.stats.cache_hits.values()))
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


def start(program: str, **options) -> subprocess.Popen:
    command = [sys.executable, "-c", program]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options)


def wait_for_process(folder: Path) -> int:
    file = folder / "pid"
    return int(wait_until(lambda: file.exists() and file.read_text(), "a process", 60.0))


@pytest.mark.long
def test_a_process_compiles_what_is_missing_and_this_one_loads_it(folder):
    for output in ("first second 2\n", "2\n"):
        with start(PROGRAM) as process:
            assert process.communicate(timeout=120)[0] == output


def test_a_background_compilation_can_be_closed(folder):
    import some_kernels

    background = Compilation([some_kernels.endless])
    background.start(print)
    pid = wait_for_process(folder)
    background.close()
    wait_until_gone(pid)


def test_the_process_ends_with_its_parent_even_if_that_is_killed(folder):
    with start(PARENT, stderr=subprocess.DEVNULL) as process:
        pid = wait_for_process(folder)
        process.send_signal(signal.SIGKILL)
        process.wait(60.0)
    wait_until_gone(pid)


@pytest.mark.long
def test_groups_are_compiled_by_several_processes_and_errors_are_raised(folder):
    import some_kernels

    names, steps = [], [some_kernels.first, some_kernels.second]
    compile_groups([[step] for step in steps], names.append, 2)
    assert sorted(names) == ["first", "second"]
    with pytest.raises(AttributeError, match="third"):
        compile_groups([[some_kernels.third], steps], names.append, 2)
