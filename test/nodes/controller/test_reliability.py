"""The benchmark of the controller's reliability runs, and its faults end the push in time."""

import json
import os

import pytest

from benchmarks.reliability_controller import LIBRARIES
from rover_planner.demo.child_process import ChildProcess, stopping_children
from support.command_line import REPOSITORY
from support.waiting import wait_until

LONGEST, LONGEST_SHOWN = 2000.0, 6000.0
"""Longest times to rest and to the error in diagnostics on a busy machine [ms]."""


@pytest.mark.slow
@pytest.mark.timed
def test_every_fault_ends_the_push_and_nothing_normal_does(tmp_path):
    words = ["--repeats", "1", "--seconds", "2", "--out", str(tmp_path / "figures.json")]
    with stopping_children() as children:
        environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
        log = tmp_path / "log"
        child = ChildProcess("benchmarks.reliability_controller", words, environment, log)
        children.append(child)
        wait_until(lambda: not child.running, "the benchmark", 400.0)
        assert child.exit_code == 0, log.read_text()
    rows = json.loads((tmp_path / "figures.json").read_text())
    found = {row["name"]: row["value"] for row in rows}
    assert len(found) == len(rows) >= 19
    stepped = "system clock stepped back by an hour: zero or hold within"
    assert (stepped in found) == bool(LIBRARIES)
    for name, value in found.items():
        if name.endswith("zero or hold within"):
            assert value < LONGEST, name
        elif name.endswith("in diagnostics within"):
            assert value < LONGEST_SHOWN, name
