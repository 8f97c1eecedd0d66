# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of a server: its map, its last question, and how long answers take."""

from dataclasses import replace

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_planner.maps.known_map import KnownMap
from rover_planner.planning.answering.server_health import LATENCIES, OK, WARN, ServerHealth


def test_the_map_is_told_with_its_age_and_coverage():
    heights = np.zeros((40, 100))
    heights[:10] = np.nan
    known = KnownMap(Terrain(heights, 0.05), Terrain(heights, 0.05), "elevation_cloud", 1, 2.0, "")
    assert known.describe(12.0) == {
        "map": "elevation_cloud",
        "map age [s]": "12.0",
        "map cells": "100 x 40",
        "map resolution [m]": "0.05",
        "map coverage [%]": "75.0",
    }
    assert replace(known, source="").describe(1.0)["map"] == "unnamed"


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


def test_old_latencies_are_forgotten_and_a_lack_of_time_is_a_warning_for_a_while():
    health = ServerHealth()
    health.take_answer("too_long", 5.0, "1, can_traverse", 9.0)
    assert health.describe(6.0, "", "", {}).level == WARN
    for number in range(LATENCIES):
        health.take_answer("", 6.0, f"{number}, check_path", 0.01)
    later = health.describe(60.0, "", "", {})
    assert later.level == OK
    assert later.values[f"largest latency of {LATENCIES} [ms]"] == "10.0"
