# SPDX-License-Identifier: Apache-2.0
"""Messages wait for listeners, and responses for those before them."""

import time
from types import SimpleNamespace

import pytest
from rclpy.node import Node
from std_msgs.msg import Int32

from rover_planner.ros import deferred
from rover_planner.ros.deferred import AT_ONCE, PAUSE, PacedSender
from rover_planner.ros.guard import Guard
from rover_planner.ros.lazy_publisher import LazyPublisher
from rover_planner.ros.qos import RESULT_QOS
from support.waiting import repeat_until, wait_until


@pytest.fixture
def busy(ros):
    """Return a node that is not spun yet."""
    return Node("busy", context=ros.context)


def listen(ros, name="listener"):
    """Return a new listener and the numbers that it hears."""
    heard, node = [], Node(name, context=ros.context)
    node.create_subscription(
        Int32, "numbers", lambda number: heard.append(number.data), RESULT_QOS
    )
    return ros.spin(node), heard


@pytest.fixture
def topic(busy):
    """Return a lazy publisher of numbers."""
    yield LazyPublisher(busy, Int32, "numbers")
    busy.destroy_node()


def test_nobody_listens_so_nothing_is_made_and_who_comes_gets_the_latest(ros, topic):
    made = []
    for number in range(3):
        topic.publish(lambda number=number: made.append(number) or Int32(data=number))
    assert made == []
    _, heard = listen(ros)
    wait_until(lambda: topic.has_listeners, "the listener")
    topic.catch_up()
    topic.catch_up()
    wait_until(lambda: heard == [2], "the latest")
    assert made == [2]
    for number in range(3, 6):
        topic.publish(lambda number=number: Int32(data=number))
    wait_until(lambda: heard == [2, 3, 4, 5], "all in order")
    _, late = listen(ros, "late_listener")
    wait_until(lambda: late == [5], "the latest alone")


def test_whoever_comes_after_a_listener_has_left_never_gets_what_is_out_of_date(ros, topic):
    visitor, seen = listen(ros, "visitor")
    wait_until(lambda: topic.has_listeners, "its match")
    topic.publish(lambda: Int32(data=1))
    wait_until(lambda: seen == [1], "the first")
    visitor.destroy_node()
    wait_until(lambda: not topic.has_listeners, "the leave")
    topic.publish(lambda: Int32(data=2))
    _, heard = listen(ros)
    repeat_until(topic.catch_up, lambda: heard, "the latest")
    assert heard == [2]


def test_a_few_responses_leave_at_once_and_many_in_groups(ros, busy, monkeypatch):
    reads = [time.monotonic()]

    def read_clock() -> float:
        if len(sent) >= AT_ONCE:  # it stands until then, however late a thread is
            reads.append(time.monotonic())
        return reads[-1]

    monkeypatch.setattr(deferred, "time", SimpleNamespace(monotonic=read_clock))
    sender, sent = PacedSender(busy, Guard(busy.get_logger())), []
    for number in range(50):
        sender.send(lambda number=number: sent.append((number, reads[-1])))
    assert [number for number, _ in sent] == list(range(AT_ONCE))
    ros.spin(busy)
    wait_until(lambda: len(sent) == 50, "all responses")
    assert [number for number, _ in sent] == list(range(50))
    times = [when for _, when in sent]
    for first, later in zip(times, times[AT_ONCE:], strict=False):
        assert later - first >= PAUSE


def test_all_that_wait_leave_at_the_end_and_an_error_stops_none(busy):
    guard, sent = Guard(busy.get_logger()), []
    sender = PacedSender(busy, guard)
    for number in range(20):
        sender.send(lambda number=number: sent.append(1 / (number - 7)))
    sender.send_all()
    assert len(sent) == 19 and guard.total == 1
