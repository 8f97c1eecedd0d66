# SPDX-License-Identifier: Apache-2.0
"""Benchmarks still run against the product as it is; what they find is not looked at here."""

import importlib
import json
import math
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="benchmarks start nodes")
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String

from benchmarks.measure import print_figures, write_figures
from benchmarks.run import TOPICS
from rover_physics import load_rover
from rover_planner.ros.qos import latched_qos, topic_qos
from support.ros_fixtures import RosRun
from support.waiting import wait_until

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
SMALL = {
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
QUICK = ("poses", "rough")
"""Topics that take a few seconds in the small size."""


@pytest.fixture(autouse=True)
def threads():
    """Leave numba with the threads that it had."""
    import numba

    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.mark.parametrize(
    "topic",
    [
        pytest.param(topic, marks=() if topic in QUICK else (pytest.mark.slow, pytest.mark.long))
        for topic in TOPICS
    ],
)
def test_every_topic_measures_in_a_small_size(topic, monkeypatch, tmp_path, capsys):
    if topic == "survey":
        pytest.importorskip("distributed", reason="install the extra survey")
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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.long
def test_energy_is_compared_with_drives_in_mujoco(capsys):
    pytest.importorskip("mujoco", reason="install the extra bench")
    importlib.import_module("benchmarks.validate").print_energy(step=19)
    assert "median error" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.long
def test_controllers_are_compared_in_mujoco(tmp_path, monkeypatch, capsys):
    pytest.importorskip("mujoco", reason="install the extra bench")
    traction = importlib.import_module("benchmarks.traction")
    monkeypatch.setattr(traction, "QUICK_STEP", 19)
    traction.main(quick=True, out=tmp_path)
    assert "Rocks and relief" in capsys.readouterr().out
    assert (tmp_path / "traction.png").is_file()
    assert len(json.loads((tmp_path / "traction.json").read_text())["drives"]) == 8


def test_soak_counts_torques_at_rest_in_the_order_of_sending_while_the_clock_is_stepped():
    from benchmarks.soak import RestWatch, sent_at

    watch = RestWatch()
    # The clock is 5 s ahead until 10.01; a loaded ear hears the fault of the step back first.
    for sent, received, what in (
        (14.90, 9.90, {"state": "driving"}),
        (10.02, 10.03, {"state": "fault"}),
        (14.98, 10.03, {"turns": True}),
        (15.00, 10.03, {"turns": True}),
        (10.02, 10.03, {"turns": False}),
    ):
        stamps = {"source_timestamp": int(1e9 * sent), "received_timestamp": int(1e9 * received)}
        watch.take(sent_at(stamps), **what)
    assert watch.find_torques() == []
    watch.take(10.50, turns=True)
    assert watch.find_torques() == ["fault for 0.48 s"]


def test_soak_hears_a_drive_between_two_faults_late_but_whole():
    from benchmarks.soak import FLIGHT, Ear

    ros = RosRun()
    controller, ear = Node("controller", context=ros.context), Ear(ros)
    states = controller.create_publisher(String, "traction_controller/state", latched_qos())
    torques = controller.create_publisher(
        Float64MultiArray, "traction_controller/commands", topic_qos()
    )
    executor = SingleThreadedExecutor(context=ros.context)
    executor.add_node(ear)

    def hear(count: int) -> bool:
        executor.spin_once(0.1)
        return len(ear.rest.find_torques()) >= count

    def turn_at_rest() -> None:
        time.sleep(2.0 * FLIGHT)
        torques.publish(Float64MultiArray(data=[1.0]))

    wait_until(lambda: states.get_subscription_count() and torques.get_subscription_count(), "ear")
    states.publish(String(data="fault"))
    turn_at_rest()
    wait_until(lambda: hear(1), "the torques in the first fault")
    states.publish(String(data="driving"))
    turn_at_rest()
    states.publish(String(data="fault"))
    turn_at_rest()
    time.sleep(2.0 * FLIGHT)  # all of it waits now
    wait_until(lambda: hear(2), "the torques in the second fault")
    assert not hear(3)
    ros.close()
