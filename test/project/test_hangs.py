"""A test run ends: where signals are ignored, and where a test hangs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
HANG = "import time\n\ndef test_that_hangs():\n    time.sleep(600.0)\n"


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


@pytest.mark.parametrize("workers", ["0", "1"])
def test_a_test_that_hangs_fails_and_says_where(tmp_path, workers):
    path = tmp_path / "test_hang.py"
    path.write_text(HANG)
    limits = ["faulthandler_timeout=2", "faulthandler_exit_on_timeout=true"]
    words = [word for limit in limits for word in ("--override-ini", limit)]
    ran = run_pytest(str(path), "--numprocesses", workers, *words)
    assert ran.returncode != 0
    assert "test_that_hangs" in ran.stdout + ran.stderr
    assert "line 4 in test_that_hangs" in ran.stdout + ran.stderr
