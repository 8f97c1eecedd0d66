# SPDX-License-Identifier: Apache-2.0
"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="benchmarks start nodes")
from benchmarks.measure import print_figures, write_figures
from benchmarks.run import TOPICS
from rover_physics import load_rover

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
SMALL = {
    "page": {"TRIES": 1},
    "paths": {"REPEATS": 1, "MANY": 5_000},
    "poses": {"POSES": 20, "ARCS": (2, 2, 2), "MAP_CELLS": 60, "MAP_ROWS": (0, 40)},
    "rest": {"SETTLING": 0.5, "SECONDS": 1.0},
    "rough": {"POSES": 10, "LOOKED_AT": 3, "CELLS": (0.4,)},
    "service": {"QUESTIONS": 20, "WARM_UP": 2, "NINES": 2, "CELLS": 60},
    "start": {"STARTS": 1, "COLD_STARTS": 0},
    "stop": {"MAPS": ((6.0, 0.05, 0.0),), "REPEATS": 2},
    "survey": {"CELLS": (48, 96), "POSES": 500},
    "traction": {"ALONE_TIME": 0.5, "TOGETHER_TIME": 1.0},
}
"""Values of each topic's constants with which it takes seconds."""


@pytest.fixture(autouse=True)
def threads():
    """Leave numba with the threads that it had."""
    import numba

    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.mark.long
@pytest.mark.parametrize("topic", TOPICS)
def test_every_topic_measures_in_a_small_size(topic, monkeypatch, tmp_path, capsys):
    if topic == "survey":
        pytest.importorskip("distributed", reason="install the extra survey")
    if topic == "page" and shutil.which("chromium") is None:
        pytest.skip("no browser is installed")
    module = importlib.import_module(f"benchmarks.bench_{topic}")
    for name, value in SMALL[topic].items():
        monkeypatch.setattr(module, name, value)
    figures = module.measure()
    names = [figure.name for figure in figures]
    assert names and len(set(names)) == len(names)
    assert all(math.isfinite(figure.value) for figure in figures)
    assert any(figure.value > 0.0 for figure in figures)
    write_figures(figures, tmp_path / "results.json")
    rows = json.loads((tmp_path / "results.json").read_text())
    assert [row["name"] for row in rows] == names
    print_figures(figures)
    assert figures[0].topic in capsys.readouterr().out


@pytest.mark.parametrize("name", sorted(file.stem for file in FOLDER.glob("*.py")))
def test_every_benchmark_can_be_imported(name):
    pytest.importorskip("mujoco", reason="install the extra bench")
    importlib.import_module(f"benchmarks.{name}")


@pytest.mark.long
def test_paths_are_searched_in_a_small_size(capsys):
    from benchmarks.path_search import SearchCase, run_case, show
    from rover_planner.worlds.mars_terrain import make_mars_terrain

    case = SearchCase("small", load_rover("lsr1"), make_mars_terrain(3, 8.0))
    asked = {"count": 2, "seed": 0, "budget": 2.0, "longest": 2.0, "warm": 1}
    rows = list(run_case(case, asked))
    assert [row["outcome"] for row in rows] == ["found", "found"]
    assert all(row["passes"] and 0.0 < row["cost"] < np.inf for row in rows)
    assert rows[0]["warm_outcome"] == "found"
    show(rows)
    assert "of all that any search finds" in capsys.readouterr().out


@pytest.mark.long
def test_energy_is_compared_with_drives_in_mujoco(capsys):
    pytest.importorskip("mujoco", reason="install the extra bench")
    importlib.import_module("benchmarks.validate").print_energy(step=19)
    assert "median error" in capsys.readouterr().out


@pytest.mark.long
def test_controllers_are_compared_in_mujoco(tmp_path, monkeypatch, capsys):
    pytest.importorskip("mujoco", reason="install the extra bench")
    traction = importlib.import_module("benchmarks.traction")
    monkeypatch.setattr(traction, "QUICK_STEP", 19)
    traction.main(quick=True, out=tmp_path)
    assert "Rocks and relief" in capsys.readouterr().out
    assert (tmp_path / "traction.png").is_file()
    assert len(json.loads((tmp_path / "traction.json").read_text())["drives"]) == 8
