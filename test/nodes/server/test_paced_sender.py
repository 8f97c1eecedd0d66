# SPDX-License-Identifier: Apache-2.0
"""Many responses leave in small groups and in order; a few leave at once."""

import time
from types import SimpleNamespace

import pytest
from rclpy.node import Node

from rover_planner.ros import paced_sender
from rover_planner.ros.guard import Guard
from rover_planner.ros.paced_sender import AT_ONCE, PAUSE, PacedSender
from support.waiting import wait_until


@pytest.fixture
def node(ros):
    return Node("sender", context=ros.context)


class Clock:
    """The steady clock as the sender reads it; at first it stands, however late a thread is."""

    def __init__(self):
        self.now, self.stands = time.monotonic(), True

    def monotonic(self) -> float:
        self.now = self.now if self.stands else time.monotonic()
        return self.now


def test_a_few_responses_leave_at_once_and_many_in_groups(ros, node, monkeypatch):
    clock = Clock()
    monkeypatch.setattr(paced_sender, "time", SimpleNamespace(monotonic=clock.monotonic))
    sender, sent = PacedSender(node, Guard(node.get_logger())), []
    for number in range(50):
        sender.send(lambda number=number: sent.append((number, clock.now)))
    assert [number for number, _ in sent] == list(range(AT_ONCE))
    clock.stands = False
    ros.spin(node)
    wait_until(lambda: len(sent) == 50, "all responses")
    assert [number for number, _ in sent] == list(range(50))
    times = [when for _, when in sent]
    for first, later in zip(times, times[AT_ONCE:], strict=False):
        assert later - first >= PAUSE


def test_all_that_wait_leave_at_the_end_and_an_error_stops_none(node):
    guard, sent = Guard(node.get_logger()), []
    sender = PacedSender(node, guard)
    for number in range(20):
        sender.send(lambda number=number: sent.append(1 / (number - 7)))
    sender.send_all()
    assert len(sent) == 19 and guard.total == 1
