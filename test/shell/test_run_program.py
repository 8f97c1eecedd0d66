# SPDX-License-Identifier: Apache-2.0
"""A program ends with an exit code and at most one short line, also where a library lacks."""

import os
import subprocess
import sys
import warnings

import pytest

from rover_physics import RoverError
from rover_planner.cli import main
from rover_planner.errors import DemoError, PlanningError
from rover_planner.shell.run_program import (
    EXIT_BAD_INPUT,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    EXIT_OK,
    EXIT_PIPE_CLOSED,
    run_program,
)
from support.project.checkout import TOP


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (PlanningError("é  is\n1"), EXIT_BAD_INPUT, "rover: é is 1\n"),
        (RoverError("\x1b[2J\u202e\udcff"), EXIT_BAD_INPUT, "rover: \\x1b[2J\\u202e\\udcff\n"),
        (DemoError("no"), EXIT_FAILED, "rover: no\n"),
        (KeyError("x"), EXIT_FAILED, "rover: internal error: KeyError: 'x'\n"),
        (MemoryError(), EXIT_FAILED, "rover: internal error: MemoryError:\n"),
        (OSError(28, "No space left"), EXIT_FAILED, "rover: the system refused: [Errno 28] No "
         "space left\n"),
        (KeyboardInterrupt(), EXIT_INTERRUPTED, ""),
        (BrokenPipeError(), EXIT_PIPE_CLOSED, ""),
        pytest.param(PlanningError("x" * 10_000_000), EXIT_BAD_INPUT, f"rover: {'x' * 290}...\n",
                     id="long"),
    ],
)  # fmt: skip
def test_every_error_is_an_exit_code_and_at_most_one_line(capfd, error, code, line):
    def run():
        raise error

    assert run_program("rover", run) == code
    assert capfd.readouterr().err == line


def test_a_warning_of_a_library_is_not_printed_unless_a_filter_asks_for_it(capfd):
    def warn():
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)

    with warnings.catch_warnings():
        warnings.resetwarnings()
        assert run_program("rover", warn) == EXIT_OK
        assert capfd.readouterr().err == ""
        warnings.simplefilter("error")
        assert run_program("rover", warn) == EXIT_FAILED
    assert "RuntimeWarning: overflow" in capfd.readouterr().err


PRINT = "import sys; from rover_planner.shell.run_program import run_program\n" + (
    "sys.exit(run_program('rover', lambda: print('x' * 100_000)))"
)
HELP = "import sys; from rover_planner.cli import main; sys.exit(main(['predict', '--help']))"


@pytest.mark.parametrize("script", [PRINT, HELP], ids=["print", "help"])
def test_output_into_a_closed_pipe_or_a_full_disk_leaves_no_traceback(script):
    environment = os.environ | {"PYTHONPATH": str(TOP)}

    def run(stdout):
        return subprocess.run(
            [sys.executable, "-c", script], stdout=stdout, stderr=subprocess.PIPE, text=True,
            env=environment, timeout=60,
        )  # fmt: skip

    reading, writing = os.pipe()
    os.close(reading)
    ended = run(writing)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (EXIT_PIPE_CLOSED, "")
    with open("/dev/full", "w") as full:
        ended = run(full)
    assert ended.returncode == EXIT_FAILED
    name = "rover" if script is PRINT else "rover_planner"
    assert ended.stderr == f"{name}: the system refused: [Errno 28] No space left on device\n"


PRESS = "import os\nos.kill(os.getpid(), 2)\n"
FORGET = (
    "import os\ntry:\n    os.kill(os.getpid(), 2)\n    len(str(os))\n"
    "except BaseException:\n    pass\n"
)


@pytest.mark.parametrize(
    ("library", "words", "content"), [("typer", [], PRESS), ("viser", ["view"], FORGET)]
)
def test_ctrl_c_ends_a_program_while_a_library_is_imported_that_may_forget_it(
    library, words, content, tmp_path
):
    (tmp_path / f"{library}.py").write_text(content)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(TOP)])}
    command = [sys.executable, "-m", "rover_planner", *words]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    assert (ended.returncode, ended.stderr) == (EXIT_INTERRUPTED, "")


@pytest.mark.parametrize(
    ("words", "module", "install"),
    [
        (("figure4", "out.png"), "matplotlib", "rover_planner[plots]"),
        (("study", "study.yaml"), "matplotlib", "rover_planner[plots]"),
        (("replay", "bag", "out"), "rosbags", "rover_planner[bags]"),
        (("replay", "bag", "out"), "rclpy", "rover_planner[ros]"),
        (("view",), "viser", "rover_planner[view]"),
        (("view", "--follow"), "rclpy", "rover_planner[ros]"),
    ],
)
def test_a_missing_library_is_named_with_what_installs_it(
    words, module, install, monkeypatch, tmp_path, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    assert main(words) == 2
    told = capsys.readouterr().err
    assert module in told or "ROS 2" in told
    assert install in told and "\n" not in told.strip()
    assert not list(tmp_path.iterdir())
