# SPDX-License-Identifier: Apache-2.0
"""Topics that are read when a node needs them."""

import time

from rclpy.node import Node
from std_msgs.msg import String

from rover_planner.ros.guard import Guard
from rover_planner.ros.polled_topics import PolledTopics
from rover_planner.ros.qos import topic_qos
from support.waiting import wait_until


def test_messages_wait_until_they_are_polled_and_errors_end_nothing(ros):
    node = Node("hearer", context=ros.context)
    guard, heard = Guard(node.get_logger()), []

    def take(message, arrival):
        heard.append((message.data, arrival))
        if message.data == "bad":
            raise ValueError("bad")

    topics = PolledTopics(node, guard)
    topics.subscribe(String, "words", take, topic_qos())
    ros.spin(node)
    publisher = ros.spin(Node("speaker", context=ros.context)).create_publisher(
        String, "words", topic_qos()
    )
    wait_until(lambda: publisher.get_subscription_count() == 1, "the subscription")
    topics.poll()
    before = time.monotonic()
    for word in ("bad", "good"):
        publisher.publish(String(data=word))
    time.sleep(0.5)
    assert not heard  # the node spins, and leaves them alone
    after = time.monotonic()
    topics.poll()
    assert [word for word, _ in heard] == ["bad", "good"]
    assert all(before - 0.01 <= arrival < after for _, arrival in heard)
    assert guard.total == 1
