"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib
import json
import math
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
TOPICS = sorted(path.stem.removeprefix("bench_") for path in BENCHMARKS.glob("bench_*.py"))
SMALL = {
    "fan": {"ARCS": (2, 2, 2), "MAP_CELLS": 60, "MAP_ROWS": (0, 40)},
    "growth": {
        "LENGTHS": (1.0, 2.0),
        "CANDIDATES": (1,),
        "MAP_SIZES": (200, 240),
        "RESOLUTIONS": (0.05,),
    },
    "hazards": {"CELLS": 120, "CHANGE": 8, "HEADINGS": 2},
    "ingestion": {"CELLS": 60},
    "maps": {"SIZES": (80,), "LOCAL": 20, "SECONDS": 0.5, "PERIOD": 0.1},
    "mujoco": {"POSES": 2, "MANY": 20},
    "parts": {"POSES": 20, "REPEATS": 2},
    "paths": {"REPEATS": 1, "MANY": 5_000},
    "reachable": {"SIDE": 300},
    "rough": {"POSES": 10, "LOOKED_AT": 3, "CELLS": (0.4,)},
    "poses": {"POSES": 20, "FLOOR_POSES": 10, "LINES": 2, "SPACING": 0.2},
    "service": {"QUESTIONS": 20, "WARM_UP": 2, "NINES": 2},
    "start": {"STARTS": 1, "COLD_STARTS": 0},
    "scheduler": {
        "SIDES": (600,),
        "WORKERS": 3,
        "POSES_PER_SECOND": 1e7,
        "MANY_WORKERS": 4,
    },
    "survey": {"CELLS": 96, "REPEATS": 1, "TURNS": 1, "COUNT": 2},
    "traction": {"ALONE_TIME": 0.5, "TOGETHER_TIME": 1.0},
    "view": {"PATHS": 1, "LENGTH": 2.0, "SLIDERS": {"friction [-]": (0.6,)}},
    "walls": {"POSES": 5, "HEIGHTS": (0.3,)},
}
"""Values of each topic's constants with which it takes seconds."""
QUICK = ("fan", "growth", "ingestion")
"""Topics that take less than two seconds in the small size."""


@pytest.fixture
def threads():
    """Leave numba with the threads that it had."""
    numba = pytest.importorskip("numba")
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


LONGER = ("rough", "scheduler", "service", "start", "survey", "view")
"""Topics that take more than ten seconds in the small size."""


def params_of_topics():
    """Return the topics with their marks."""
    marks = {topic: (pytest.mark.slow,) for topic in TOPICS if topic not in QUICK}
    marks |= {topic: (pytest.mark.slow, pytest.mark.long) for topic in LONGER}
    return [pytest.param(topic, marks=marks.get(topic, ())) for topic in TOPICS]


@pytest.mark.parametrize("topic", params_of_topics())
def test_every_topic_measures_in_a_small_size(topic, monkeypatch, tmp_path, capsys, threads):
    if topic == "mujoco":
        pytest.importorskip("mujoco", reason="install the extra bench")
    if topic in ("reachable", "survey", "scheduler"):
        pytest.importorskip("distributed", reason="install the extra survey")
    module = importlib.import_module(f"benchmarks.bench_{topic}")
    for name, value in SMALL[topic].items():
        monkeypatch.setattr(module, name, value)
    figures = module.measure()
    names = [(figure.topic, figure.name) for figure in figures]
    assert names and len(set(names)) == len(names)
    assert all(math.isfinite(figure.value) for figure in figures)
    assert any(figure.value > 0.0 for figure in figures)
    measure = importlib.import_module("benchmarks.measure")
    measure.write(figures, tmp_path / "results.json")
    rows = json.loads((tmp_path / "results.json").read_text())
    assert [(row["topic"], row["name"]) for row in rows] == names
    measure.show(figures)
    assert figures[0].topic in capsys.readouterr().out


def test_medians_are_of_calls_in_turns():
    measure = importlib.import_module("benchmarks.measure")
    calls, ticks = [], iter(range(1000))
    functions = [lambda: calls.append("a"), lambda: calls.append("b")]
    assert measure.median_times(functions, 3, lambda: float(next(ticks))) == [1.0, 1.0]
    assert calls == ["a", "b"] * 4
    assert [measure.quantile(range(1, 101), share) for share in (0.0, 0.5, 0.99, 1.0)] == [
        1,
        50,
        99,
        100,
    ]


@pytest.mark.parametrize(
    ("value", "target", "at_least", "met"),
    [
        (3.0, 4.0, False, True),
        (5.0, 4.0, False, False),
        (5.0, 4.0, True, True),
        (5.0, None, 0, None),
    ],
)
def test_figures_say_whether_their_target_is_met_and_become_a_file(
    value, target, at_least, met, tmp_path, capsys
):
    measure = importlib.import_module("benchmarks.measure")
    figure = measure.Figure("topic", "name", value, "us", target, bool(at_least))
    measure.write([figure], tmp_path / "new" / "results.json")
    (row,) = json.loads((tmp_path / "new" / "results.json").read_text())
    assert row["met"] is met and row["value"] == value and row["repeats"] >= 5
    measure.show([figure])
    assert ("\u2713" in capsys.readouterr().out) == bool(met)


def test_the_fan_has_as_many_paths_as_enav(monkeypatch):
    fan = (
        importlib.import_module("benchmarks.bench_fan").enav_fan(0.0).reshape(14 * 11 * 11, 24, 3)
    )
    steps = np.linalg.norm(np.diff(fan[:, :, :2], axis=1), axis=2)
    np.testing.assert_allclose(steps, 0.25)


@pytest.mark.slow
def test_ways_are_compared_with_the_best_of_the_lattice_in_a_small_size(capsys):
    ways = importlib.import_module("benchmarks.ways")
    trials = importlib.import_module("benchmarks.way_trials.grounds")
    rover = importlib.import_module("rover_physics.rover.rover_file").load_rover("lsr1")
    worlds = importlib.import_module("rover_planner.worlds.mars_terrain")
    case = trials.Case("small", rover, worlds.make_mars_terrain(3, 8.0), "equal")
    asked = {"count": 2, "seed": 0, "budget": 2.0, "truth": 2, "truth_seconds": 100.0, "warm": 1}
    asked |= {"ompl": 0, "threads": 1, "nodes": 1000, "edges": 60}
    rows = list(ways.run_case(case, asked))
    assert [row.get("outcome") for row in rows] == ["found", "found", None, None]
    assert all(row["passes"] and 0.0 < row["best"] < np.inf for row in rows[:2])
    assert rows[0]["warm_outcome"] == "found" and rows[0]["same_on_threads"] is not False
    assert rows[2]["wrong"] == 0
    assert rows[3]["ranked"] == 60 and 0 < rows[3]["refused"] < 60
    assert 0.5 < rows[3]["rank"] <= 1.0
    ways.show(rows)
    assert "found of connected" in capsys.readouterr().out
