"""Many responses leave in small groups and in order; a few leave at once."""

import time

import pytest
from rclpy.node import Node

from rover_planner.ros.guard import Guard
from rover_planner.ros.paced_sender import AT_ONCE, PAUSE, PacedSender
from support.waiting import wait_until


@pytest.fixture
def node(ros):
    return Node("sender", context=ros.context)


def test_a_few_responses_leave_at_once_and_many_in_groups(ros, node):
    sender, sent = PacedSender(node, Guard(node.get_logger())), []
    for number in range(50):
        sender.send(lambda number=number: sent.append((number, time.monotonic())))
    assert [number for number, _ in sent] == list(range(AT_ONCE))
    ros.spin(node)
    wait_until(lambda: len(sent) == 50, "all responses")
    assert [number for number, _ in sent] == list(range(50))
    times = [when for _, when in sent]
    for first, later in zip(times, times[AT_ONCE:], strict=False):
        assert later - first > 0.5 * PAUSE


def test_all_that_wait_leave_at_the_end_and_an_error_stops_none(node):
    guard, sent = Guard(node.get_logger()), []
    sender = PacedSender(node, guard)
    for number in range(20):
        sender.send(lambda number=number: sent.append(1 / (number - 7)))
    sender.send_all()
    assert len(sent) == 19 and guard.total == 1
