# SPDX-License-Identifier: Apache-2.0
"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib
import json
import math
import shutil

import pytest

pytest.importorskip("rclpy", reason="benchmarks start nodes")
from benchmarks.measure import print_figures, write_figures
from benchmarks.run import TOPICS
from support.project.checkout import TOP

SMALL = {
    "page": {"TRIES": 1},
    "paths": {"REPEATS": 1, "MANY": 5_000},
    "poses": {"POSES": 10, "MAP_CELLS": 60, "MAP_ROWS": (0, 40)},
    "rest": {"SETTLING": 0.5, "SECONDS": 1.0},
    "rough": {"LOOKED_AT": 3, "CELLS": (0.4,)},
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


@pytest.mark.parametrize("name", sorted(file.stem for file in (TOP / "benchmarks").glob("*.py")))
def test_every_benchmark_can_be_imported(name):
    pytest.importorskip("mujoco", reason="install the extra bench")
    importlib.import_module(f"benchmarks.{name}")
