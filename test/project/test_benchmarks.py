"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
TOPICS = sorted(path.stem for path in BENCHMARKS.glob("bench_*.py"))


@pytest.mark.parametrize("topic", TOPICS)
def test_every_topic_can_be_measured(topic):
    if topic == "bench_mujoco":
        pytest.importorskip("mujoco", reason="install the extra bench")
    assert callable(importlib.import_module(f"benchmarks.{topic}").measure)


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


def test_a_small_map_is_taken_in_any_order(monkeypatch):
    ingestion = importlib.import_module("benchmarks.bench_ingestion")
    monkeypatch.setattr(ingestion, "CELLS", 60)
    assert all(figure.value > 0.0 for figure in ingestion.measure())
