# SPDX-License-Identifier: Apache-2.0
"""A test run ends where its caller ignores signals."""

import os
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]


def run_pytest(*words: str, before: str = "") -> subprocess.CompletedProcess[str]:
    """Run pytest from a shell, as `make test` does; `before` is what the shell does first."""
    kept = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    command = [sys.executable, "-m", "pytest", "-q", *words]
    return subprocess.run(
        ["bash", "-c", f'{before}\nexec "$0" "$@"', *command],
        capture_output=True, text=True, env=kept, cwd=REPOSITORY, timeout=120, check=False,
    )  # fmt: skip


def test_signals_reach_children_where_the_caller_ignores_them():
    """In a shell's background job tests waited for ever for a child that they had interrupted."""
    chosen = "test_no_child_outlives_a_parent_that_is_signalled[2--2]"
    ran = run_pytest(f"test/command/test_child_process.py::{chosen}", before="trap '' INT")
    assert ran.returncode == 0, ran.stdout
