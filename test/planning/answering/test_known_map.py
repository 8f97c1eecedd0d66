# SPDX-License-Identifier: Apache-2.0
"""A map's age, hash and description, and the health of a server: questions and latencies."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rover_physics import Terrain
from rover_planner.maps.known_map import KnownMap
from rover_planner.planning.answering.server_health import LATENCIES, OK, WARN, ServerHealth
from support.grounds import make_terrain, waves
from support.services import make_service

SECOND = 10**9
FLAT = Terrain(np.zeros((30, 30)), 0.1)


@pytest.mark.parametrize(
    ("stamp", "ros_time", "steady", "age", "told"),
    [
        (None, 50, 3.0, 3.0, "^$"),
        (None, 50, 6.0, 6.0, "is 6.0 s old"),
        (10 * SECOND, 15, 3.0, 5.0, "^$"),
        (3600 * SECOND, 15, 3.0, 3.0, "3585.0 s in the future"),
    ],
)
def test_the_longer_of_both_ages_counts_and_the_future_is_told_apart(
    stamp, ros_time, steady, age, told
):
    there = KnownMap(FLAT, FLAT, "a topic", stamp, 0.0)
    assert there.age(ros_time * SECOND, steady) == pytest.approx(age)
    assert re.search(told, there.describe_age(ros_time * SECOND, steady, 5.0))


def test_a_stale_map_is_refused_and_the_same_map_again_is_not():
    service = make_service(make_terrain(waves), max_map_age=60.0)
    arrival = service.known_map.arrival - 61.0
    service.known_map = replace(service.known_map, arrival=arrival)
    ends = (0.0, 0.0, 0.0), (0.5, 0.0, 0.0)
    assert service.snapshot().answer(*ends).code == "stale_map"
    before = service.terrain
    assert not service.take_terrain(make_terrain(waves))  # nothing new in it
    assert service.snapshot().answer(*ends).traversable
    assert service.terrain is before  # so that nothing is judged again


def test_any_change_of_a_terrain_changes_its_hash_and_nothing_else_does():
    layer = np.full((30, 30), 0.5)
    other = np.zeros((30, 30))
    other[3, 4] = 1e-9
    changes = [
        {"elevation": other},
        {"elevation": np.zeros((20, 45))},
        {"resolution": 0.2},
        {"origin": (0.0, 1.0)},
        {"friction": layer},
        {"elevation_std": layer},
        {"ground_class": np.ones((30, 30))},
    ]
    hashes = {one.fingerprint for one in (FLAT, *(replace(FLAT, **change) for change in changes))}
    assert len(hashes) == 1 + len(changes) and {len(text) for text in hashes} == {16}
    assert Terrain(np.zeros((30, 30), np.float32), 0.1).fingerprint == FLAT.fingerprint
    assert FLAT.fingerprint is FLAT.fingerprint  # found once
    holes = np.zeros((2, 30, 30))
    holes[0, 1, 1], holes[1, 1, 1] = np.nan, -np.nan
    assert Terrain(holes[0], 0.1).fingerprint == Terrain(holes[1], 0.1).fingerprint


def test_old_latencies_are_forgotten_and_a_lack_of_time_is_a_warning_for_a_while():
    health = ServerHealth()
    health.take_answer("too_long", 5.0, "1, can_traverse", 9.0)
    assert health.describe(6.0, "", "", {}).level == WARN
    for number in range(LATENCIES):
        health.take_answer("", 6.0, f"{number}, check_path", 0.01)
    later = health.describe(60.0, "", "", {})
    assert (later.level, later.message) == (OK, "ready")
    assert later.values[f"largest latency of {LATENCIES} [ms]"] == "10.0"
