# SPDX-License-Identifier: Apache-2.0
"""Trials of a traverse server in its own process: many questions at once, a signal."""

import itertools
import json
import os
import signal
import time
from collections import Counter

import pytest

from benchmarks.processes import SERVER, START_TIME, open_nodes
from msg_adapters.identity import path_hash
from msg_adapters.paths import poses_path
from support.grounds import make_terrain, waves
from support.ros_fixtures import finish
from support.waiting import wait_until

pytestmark = [pytest.mark.long, pytest.mark.timed]
LATE = 2.0
"""How late an answer may be on a busy machine [s]; docs/validation.md has the quiet figure."""
HEAVY = {"waypoint_spacing": 0.001, "candidate_count": 99, "candidate_spacing": 0.01}
"""Parameters with which a question of some metres takes minutes."""


@pytest.fixture
def nodes():
    with open_nodes() as opened:
        yield opened


def test_fifty_questions_at_once_are_answered_or_refused_within_the_budget(nodes):
    budget, ground = 1.0, make_terrain(waves, half=47.0)
    nodes.start(SERVER, terrain_file=ground, time_budget=budget, waypoint_spacing=0.001)
    clients = [nodes.client(f"asker{k}").connect() for k in range(5)]
    path = poses_path([(-45.0, 0.0, 0.0), (45.0, 0.0, 0.0)], "map")
    clients[0].publish(path)
    wait_until(lambda: clients[0].check()["path_hash"] == path_hash(path), "the path", START_TIME)
    began = time.monotonic()
    futures = [asker.begin_check() for asker in itertools.islice(itertools.cycle(clients), 50)]
    messages = [finish(future, budget + 30.0).message for future in futures]
    assert time.monotonic() - began < budget + LATE
    codes = Counter(json.loads(message)["code"] or "traversable" for message in messages)
    assert codes.keys() <= {"traversable", "busy", "too_long"} and codes["busy"] >= 40


def test_a_signal_during_a_question_ends_the_server_soon(nodes):
    ground = make_terrain(waves)
    server = nodes.start(SERVER, planner="fan", terrain_file=ground, time_budget=600.0, **HEAVY)
    future = nodes.client("asker").connect().begin_plan((-3.0, 0.0, 0.0), (3.0, 0.5, 0.0))
    time.sleep(0.5)
    assert not future.done()
    began = time.monotonic()
    os.kill(server.pid, signal.SIGINT)
    wait_until(lambda: not server.running, "the end of the server")
    assert time.monotonic() - began < 1.5 and server.exit_code == 0, server.last_line()
