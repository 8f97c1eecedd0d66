# SPDX-License-Identifier: Apache-2.0
"""A traverse server in its own process is asked many questions at once."""

import itertools
import json
import time
from collections import Counter

import pytest

from benchmarks.processes import SERVER, START_TIME, open_nodes
from msg_adapters.identity import path_hash
from msg_adapters.paths import poses_path
from support.grounds import make_terrain, waves
from support.ros_fixtures import finish
from support.waiting import wait_until

LATE = 2.0
"""How late an answer may be on a busy machine [s]; docs/validation.md has the quiet figure."""


@pytest.mark.long
@pytest.mark.timed
def test_fifty_questions_at_once_are_answered_or_refused_within_the_budget():
    budget, ground = 1.0, make_terrain(waves, half=47.0)
    path = poses_path([(-45.0, 0.0, 0.0), (45.0, 0.0, 0.0)], "map")
    with open_nodes() as nodes:
        nodes.start(SERVER, terrain_file=ground, time_budget=budget, waypoint_spacing=0.001)
        first, *_ = clients = [nodes.client(f"asker{k}").connect() for k in range(5)]
        first.publish(path)
        wait_until(lambda: first.check()["path_hash"] == path_hash(path), "the path", START_TIME)
        began = time.monotonic()
        futures = [asker.begin_check() for asker in itertools.islice(itertools.cycle(clients), 50)]
        messages = [finish(future, budget + 30.0).message for future in futures]
        assert time.monotonic() - began < budget + LATE
    codes = Counter(json.loads(message)["code"] or "traversable" for message in messages)
    assert codes.keys() <= {"traversable", "busy", "too_long"} and codes["busy"] >= 40
