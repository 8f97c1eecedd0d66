# SPDX-License-Identifier: Apache-2.0
"""Topics that are read when a node needs them."""

import itertools
import time

from rclpy.node import Node
from std_msgs.msg import String

from rover_planner.ros.guard import Guard
from rover_planner.ros.polled_topics import PolledTopics
from rover_planner.ros.qos import TOPIC_QOS
from support.waiting import wait_until

NAMES, WORDS = ("questions", "answers"), ["bad", "good", "better", "best"]


def test_messages_wait_until_polled_come_in_the_order_of_arrival_and_errors_end_nothing(ros):
    node = Node("hearer", context=ros.context)
    guard, heard = Guard(node.get_logger()), []

    def take(message, arrival):
        heard.append((message.data, arrival))
        if message.data == "bad":
            raise ValueError("bad")

    topics = PolledTopics(node, guard)
    for name in NAMES:
        topics.subscribe(String, name, take, TOPIC_QOS)
    ros.spin(node)
    speaker = ros.spin(Node("speaker", context=ros.context))
    publishers = [speaker.create_publisher(String, name, TOPIC_QOS) for name in NAMES]
    for publisher in publishers:
        wait_until(publisher.get_subscription_count, "the subscription")
    topics.poll()
    before = time.monotonic()
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
