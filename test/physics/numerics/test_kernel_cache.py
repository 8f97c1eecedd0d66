# SPDX-License-Identifier: Apache-2.0
"""Kernels are kept on disk where that is possible, and compile where it is not."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import rover_physics.numerics
from support.project.without_disk import drop_rights, read_only

pytestmark = pytest.mark.long

CALLEE = """
from rover_physics.numerics.kernels import kernel

@kernel
def twice(x):
    return 2.0 * x
"""
CALLER = """
from rover_physics.callee import twice
from rover_physics.numerics.kernels import kernel

@kernel
def twice_and_one(x):
    return twice(x) + 1.0
"""
PROGRAM = """
from rover_physics.caller import twice_and_one
from rover_physics.numerics.kernel_cache import kernel_cache_note

value = twice_and_one(3.0)
print(value, sum(twice_and_one.whole.stats.cache_hits.values()), kernel_cache_note(), sep="|")
"""


class SmallPackage:
    """A copy of the package with two kernels, one of which calls the other, and a home."""

    def __init__(self, top: Path):
        self.top, self.package, self.home = top, top / "rover_physics", top / "home"
        self.home.mkdir()
        numerics = self.package / "numerics"
        numerics.mkdir(parents=True)
        for name in ("kernels.py", "kernel_cache.py"):
            shutil.copy(Path(rover_physics.numerics.__file__).parent / name, numerics)
        for name, text in (("__init__", ""), ("callee", CALLEE), ("caller", CALLER)):
            (self.package / f"{name}.py").write_text(text)
        (numerics / "__init__.py").write_text("")

    def run(self, prepare=None) -> tuple[float, int, str]:
        """Call the kernel in a new process; return its value, the cache hits and the note."""
        away = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
        environment = {name: text for name, text in os.environ.items() if name not in away}
        environment |= {"PYTHONPATH": str(self.top), "HOME": str(self.home)}
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            env=environment,
            cwd=self.top,
            preexec_fn=prepare,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0 and done.stderr == "", done.stderr
        value, hits, note = done.stdout.strip().split("|")
        return float(value), int(hits), note


@pytest.fixture
def package(tmp_path):
    return SmallPackage(tmp_path)


def test_only_the_kernel_that_python_calls_is_kept_on_disk_and_used_where_none_can_be_written(
    package,
):
    assert package.run() == (7.0, 0, "")
    kept = {file.name.split("-")[0] for file in package.package.rglob("*.nbc")}
    assert kept == {"caller.twice_and_one"}
    with read_only(package.top):
        assert package.run(drop_rights) == (7.0, 1, "")


def test_kernels_compile_where_no_folder_can_be_written_and_the_note_says_so(package):
    with read_only(package.top):
        value, hits, note = package.run(drop_rights)
    assert (value, hits) == (7.0, 0)
    assert note == f"Permission denied: {package.package / '__pycache__'}"


def test_a_damaged_file_is_compiled_again(package):
    package.run()
    for ending, left in (("nbi", 20), ("nbc", 0)):
        for file in (package.package / "__pycache__").glob(f"*.{ending}"):
            file.write_bytes(file.read_bytes()[:left])
        assert package.run() == (7.0, 0, ""), (ending, left)
    assert package.run() == (7.0, 1, "")


def test_kernels_in_the_folder_of_a_user_are_not_used_after_another_file_has_changed(package):
    with read_only(package.package):
        assert package.run(drop_rights) == (7.0, 0, "")
        assert package.run(drop_rights) == (7.0, 1, "")
    # The kernel `twice` is compiled into `twice_and_one`, whose own file does not change.
    (package.package / "callee.py").write_text(CALLEE.replace("2.0", "5.0"))
    with read_only(package.package):
        assert package.run(drop_rights) == (16.0, 0, "")
