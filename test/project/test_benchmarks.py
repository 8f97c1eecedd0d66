"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib
import json
import math

import pytest

from benchmarks.measure import print_figures, write_figures
from benchmarks.run import TOPICS

SMALL = {
    "faults": {"REPEATS": 1},
    "load": {"QUESTIONS": 10, "SECONDS": 2.0, "REPEATS": 1},
    "paths": {"REPEATS": 1, "MANY": 5_000},
    "poses": {"POSES": 20, "ARCS": (2, 2, 2), "MAP_CELLS": 60, "MAP_ROWS": (0, 40)},
    "rough": {"POSES": 10, "LOOKED_AT": 3, "CELLS": (0.4,)},
    "service": {"QUESTIONS": 20, "WARM_UP": 2, "NINES": 2},
    "start": {"STARTS": 1, "COLD_STARTS": 0},
    "survey": {"CELLS": (96, 96), "HEADINGS": 2, "POSES": 200},
    "traction": {"ALONE_TIME": 0.5, "TOGETHER_TIME": 1.0},
}
"""Values of each topic's constants with which it takes seconds."""
SHORT = ("poses",)
"""Topics that take a second in the small size."""


def marks_of(topic):
    return () if topic in SHORT else (pytest.mark.slow, pytest.mark.long)


@pytest.fixture
def threads():
    """Leave numba with the threads that it had."""
    numba = pytest.importorskip("numba")
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.mark.parametrize("topic", [pytest.param(topic, marks=marks_of(topic)) for topic in TOPICS])
def test_every_topic_measures_in_a_small_size(topic, monkeypatch, tmp_path, capsys, threads):
    module = importlib.import_module(f"benchmarks.bench_{topic}")
    for name, value in SMALL[topic].items():
        monkeypatch.setattr(module, name, value)
    figures = module.measure()
    names = [(figure.topic, figure.name) for figure in figures]
    assert names and len(set(names)) == len(names)
    assert all(math.isfinite(figure.value) for figure in figures)
    assert any(figure.value > 0.0 for figure in figures)
    write_figures(figures, tmp_path / "results.json")
    rows = json.loads((tmp_path / "results.json").read_text())
    assert [(row["topic"], row["name"]) for row in rows] == names
    print_figures(figures)
    assert figures[0].topic in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.slow
def test_paths_are_compared_with_the_best_of_the_lattice_in_a_small_size(capsys):
    from benchmarks.ways import Case, run_case, show
    from rover_physics import load_rover
    from rover_planner.worlds.mars_terrain import make_mars_terrain

    case = Case("small", load_rover("lsr1"), make_mars_terrain(3, 8.0), "equal")
    asked = {"count": 2, "seed": 0, "budget": 2.0, "truth": 2, "truth_seconds": 100.0, "warm": 1}
    rows = list(run_case(case, asked))
    assert [row["outcome"] for row in rows] == ["found", "found"]
    assert all(row["passes"] and 0.0 < row["best"] < math.inf for row in rows)
    assert rows[0]["warm_outcome"] == "found"
    show(rows)
    assert "found" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.slow
def test_hostile_inputs_over_dds_do_no_harm():
    from benchmarks.fuzz import fuzz

    fuzzer = fuzz(seed=7, count=150)
    assert fuzzer.defects == [] and sum(fuzzer.counts.values()) >= 150
