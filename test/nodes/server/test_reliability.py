# SPDX-License-Identifier: Apache-2.0
"""Trials of a traverse server in its own process: bursts, no pause between questions, death."""

import pytest

from benchmarks import bench_load
from benchmarks.processes import open_nodes

pytestmark = [pytest.mark.long, pytest.mark.timed]
LATE = 2.0
"""How late an answer may be on a busy machine [s]; docs/reliability.md has the quiet figure."""


@pytest.fixture
def nodes():
    with open_nodes() as opened:
        yield opened


@pytest.mark.parametrize(
    ("budget", "half_length", "spacing", "busy"), [(5.0, 1.5, 0.05, 0), (1.0, 45.0, 0.001, 40)]
)
def test_fifty_questions_at_once_are_answered_or_refused_within_the_budget(
    nodes, budget, half_length, spacing, busy
):
    found = bench_load.burst(nodes, 50, budget, half_length, spacing)
    assert found.codes.keys() <= {"traversable", "busy", "too_long"}
    assert sum(found.codes.values()) == 50 and found.codes["busy"] >= busy
    assert max(found.times) < budget + LATE


def test_no_answer_is_lost_under_questions_without_a_pause(nodes):
    found = bench_load.soak(nodes, 4.0, clients=2)
    assert len(found.times) > 20 and found.lost == found.refused == 0


def test_after_a_sudden_death_a_new_server_has_the_latched_map(nodes):
    answer, plan = bench_load.time_restart(nodes)
    assert 0.0 < answer <= plan < 15.0


def test_requests_are_served_during_a_question(nodes):
    assert max(figure.value for figure in bench_load.time_hearing(nodes, 1)) < 1000.0


def test_a_signal_during_a_question_ends_the_server_soon(nodes):
    assert bench_load.time_signal(nodes) < 1.5
