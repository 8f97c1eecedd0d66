"""The benchmark of the controller's reliability runs, and its faults end the push in time."""

import json
import os
import subprocess
import sys

import pytest

from benchmarks.reliability_controller import LIBRARIES, LIMIT, SHOWN_LIMIT
from support.command_line import REPOSITORY

BUSY = 2.0
"""Share of the limit that tests on a busy machine allow."""


@pytest.mark.slow
def test_every_fault_ends_the_push_and_nothing_normal_does(tmp_path):
    words = ["--repeats", "1", "--seconds", "2", "--out", str(tmp_path / "figures.json")]
    subprocess.run(
        [sys.executable, "-m", "benchmarks.reliability_controller", *words],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        cwd=REPOSITORY,
        check=True,
        timeout=200,
        capture_output=True,
    )
    rows = json.loads((tmp_path / "figures.json").read_text())
    found = {row["name"]: row["value"] for row in rows}
    assert len(found) == len(rows) >= 19
    stepped = "system clock stepped back by an hour: zero or hold within"
    assert (stepped in found) == bool(LIBRARIES)
    for name, value in found.items():
        if name.endswith("zero or hold within"):
            assert value < BUSY * LIMIT, name
        elif name.endswith("in diagnostics within"):
            assert value < BUSY * SHOWN_LIMIT, name
