# SPDX-License-Identifier: Apache-2.0
"""`warm-up` compiles all kernels once, and says so if they cannot be kept."""

import os
import subprocess
import sys
from dataclasses import replace

import pytest

from rover_planner.nodes import warm_up
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.query import Site
from support.grounds import plane
from support.project.without_disk import fill_disk
from support.rovers import LSR1

LOAD_ALL = """
from rover_physics.compilation import load
from rover_planner.nodes.warm_up import GROUPS
print([load(step) for group in GROUPS for step in group])
"""


def run(*words, **options):
    return subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, timeout=600, **options
    )


@pytest.mark.long
@pytest.mark.slow
def test_after_it_every_kernel_is_on_disk(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    first = run("-m", "rover_planner", "warm-up", env=environment)
    assert first.returncode == 0 and str(tmp_path) in first.stdout
    for name in ("evaluate poses", "bound poses", "control traction"):
        assert f"compiling to {name}\n" in first.stderr
    again = run("-m", "rover_planner", "warm-up", env=environment)
    assert again.returncode == 0 and again.stderr == ""
    loaded = run("-c", LOAD_ALL, env=environment)
    assert loaded.returncode == 0 and "False" not in loaded.stdout


def test_bounds_are_loaded_before_the_budget_of_a_search_where_heights_are_uncertain(monkeypatch):
    loaded = []
    monkeypatch.setattr(warm_up, "search_paths", lambda: loaded.append("search"))
    monkeypatch.setattr(warm_up, "bound_poses", lambda: loaded.append("bounds"))
    exact = plane(0.0, 0.0)
    uncertain = replace(exact, elevation_std=0.01 + 0.0 * exact.elevation)
    for ground in (exact, uncertain):
        warm_up.prepare_search(Site(LSR1, ground, PathQueryOptions()))
    assert loaded == ["search", "search", "bounds"]


def test_on_a_full_disk_it_says_where_kernels_cannot_be_kept(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = run("-m", "rover_planner", "warm-up", env=environment, preexec_fn=fill_disk)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "cannot be kept" in done.stderr and str(tmp_path) in done.stderr
