# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of a server: its map, its last question, and how long answers take."""

import numpy as np
import pytest

from rover_physics.terrain.grid import Terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.map_status import MapStatus
from rover_planner.planning.answering.server_health import LATENCIES, OK, WARN, ServerHealth
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.traverse_service import TraverseService

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def service() -> TraverseService:
    return TraverseService(load_service_settings(TraverseServerParameters()))


def test_the_map_is_told_with_its_age_and_coverage(service):
    status = MapStatus()
    assert status.describe(service.situation()) == {"map": "none"}
    heights = np.zeros((40, 100))
    heights[:10] = np.nan
    service.take_terrain(Terrain(heights, 0.05, (0.0, 0.0)), "elevation_cloud", 100 * SECOND)
    told = status.describe(service.situation(112 * SECOND))
    assert told == {
        "map": "elevation_cloud",
        "map age [s]": "12.0",
        "map cells": "100 x 40",
        "map resolution [m]": "0.05",
        "map coverage [%]": "75.0",
    }
    service.take_terrain(Terrain(np.zeros((40, 100)), 0.05, (0.0, 0.0)), "", 111 * SECOND)
    told = status.describe(service.situation(112 * SECOND))
    assert (told["map"], told["map age [s]"]) == ("unnamed", "1.0")
    assert told["map coverage [%]"] == "100.0"


def test_the_last_question_is_told_with_its_latency():
    health = ServerHealth()
    assert health.describe(0.0, "", "", {}).values == {"last question": "none"}
    health.take_answer("", 10.0, "1, can_traverse", 0.25)
    health.take_answer("friction", 12.0, "2, check_path", 0.015)
    told = health.describe(13.5, "", "", {"open questions": 0})
    assert (told.level, told.message) == (OK, "ready")
    assert told.values == {
        "open questions": 0,
        "last question": "2, check_path",
        "last answer": "friction",
        "last answer age [s]": "1.5",
        "last latency [ms]": "15.0",
        "largest latency of 2 [ms]": "250.0",
        "answers friction": 1,
        "answers traversable": 1,
    }


def test_old_latencies_are_forgotten():
    health = ServerHealth()
    health.take_answer("", 0.0, "1, check_path", 9.0)
    for number in range(LATENCIES):
        health.take_answer("", 1.0, f"{number}, check_path", 0.01)
    assert (
        health.describe(1.0, "", "", {}).values[f"largest latency of {LATENCIES} [ms]"] == "10.0"
    )


def test_a_question_without_time_is_a_warning_for_a_while():
    health = ServerHealth()
    health.take_answer("too_long", 5.0, "1, can_traverse", 5.0)
    assert health.describe(6.0, "", "", {}).level == WARN
    assert health.describe(60.0, "", "", {}).level == OK
