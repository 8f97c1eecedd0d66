# SPDX-License-Identifier: Apache-2.0
"""Topics that are read when a node needs them."""

import itertools
import time
from types import SimpleNamespace

import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from msg_adapters.errors import MessageError
from rover_planner.ros.guard import Guard
from rover_planner.ros.polled_topics import PolledTopics
from rover_planner.ros.qos import topic_qos
from support.waiting import wait_until

NAMES, WORDS = ("questions", "answers"), ["bad", "good", "better", "best"]


@pytest.fixture
def advertise(ros):
    """Return a function that makes publishers of topics by name, which are heard."""
    speaker = ros.spin(Node("speaker", context=ros.context))

    def make(kind, *names):
        publishers = [speaker.create_publisher(kind, name, topic_qos()) for name in names]
        wait_until(lambda: all(p.get_subscription_count() for p in publishers), "the topics")
        return publishers

    return make


def test_messages_wait_until_polled_come_in_the_order_of_arrival_and_errors_end_nothing(
    ros, advertise
):
    node = Node("hearer", context=ros.context)
    guard, heard = Guard(node.get_logger()), []

    def take(message, arrival):
        heard.append((message.data, arrival))
        if message.data == "bad":
            raise ValueError("bad")

    topics = PolledTopics(node, guard)
    for name in NAMES:
        topics.subscribe(String, name, take, topic_qos())
    due: list[bool] = []
    topics.subscribe(String, "news", take, topic_qos(), lambda: bool(due))
    ros.spin(node)
    *publishers, news = advertise(String, *NAMES, "news")
    topics.poll()
    before = time.monotonic()
    news.publish(String(data="later"))
    for publisher, word in zip(itertools.cycle(publishers), WORDS, strict=False):
        publisher.publish(String(data=word))
        time.sleep(0.02)
    time.sleep(0.5)
    assert not heard  # the node spins, and leaves them alone
    after = time.monotonic()
    topics.poll()
    assert [word for word, _ in heard] == WORDS
    assert all(before - 0.01 <= arrival < after for _, arrival in heard)
    assert guard.total == 1
    due.append(True)
    topics.poll()
    assert heard[-1][0] == "later"


def test_what_cannot_be_used_is_logged_once_or_refused_by_who_asks(ros, advertise, monkeypatch):
    node, lines, refused = Node("hearer", context=ros.context), [], []
    monkeypatch.setattr(node, "get_logger", lambda: SimpleNamespace(warning=lines.append))
    guard = Guard(SimpleNamespace(error=lines.append))

    def take(message, _arrival):
        if not message.position:
            raise MessageError("no positions")

    topics = PolledTopics(node, guard)
    topics.subscribe(JointState, "joints", take, topic_qos())
    topics.subscribe(
        JointState, "others", take, topic_qos(), refuse=lambda name, error, _: refused.append(name)
    )
    joints, others = advertise(JointState, "joints", "others")
    for publisher in (joints, joints, others):
        publisher.publish(JointState())

    def poll():
        topics.poll()
        return refused and lines

    wait_until(poll, "both refusals")
    assert refused == ["others"] and lines == ["joints not used: no positions"]
    assert guard.total == 0
