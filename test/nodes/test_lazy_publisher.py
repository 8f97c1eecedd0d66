"""A message is made only for those who listen, and whoever comes later gets the latest."""

import pytest
from rclpy.node import Node
from std_msgs.msg import Int32

from rover_planner.ros.lazy_publisher import LazyPublisher
from rover_planner.ros.qos import result_qos
from support.ros_fixtures import wait_until


def listen(ros, name="listener"):
    """Return a list of the numbers that a new listener hears."""
    heard = []
    node = Node(name, context=ros.context)
    node.create_subscription(
        Int32, "numbers", lambda number: heard.append(number.data), result_qos()
    )
    ros.spin(node)
    return heard


def test_nobody_listens_so_nothing_is_made_and_the_latest_is_kept(ros):
    node, made = Node("speaker", context=ros.context), []
    topic = LazyPublisher(node, Int32, "numbers")
    for number in range(3):
        topic.publish(lambda number=number: made.append(number) or Int32(data=number))
    assert made == [] and not topic.is_awaited
    heard = listen(ros)
    wait_until(lambda: topic.is_awaited, "the listener")
    topic.catch_up()
    topic.catch_up()
    wait_until(lambda: heard == [2], "the latest")
    assert made == [2] and not topic.is_awaited
    node.destroy_node()


def test_listeners_hear_all_in_order_and_late_ones_what_was_published(ros):
    node = Node("speaker", context=ros.context)
    topic = LazyPublisher(node, Int32, "numbers")
    topic.publish(lambda: Int32(data=0))
    heard = listen(ros)
    wait_until(lambda: topic.is_awaited, "the listener")
    for number in range(1, 4):
        topic.publish(lambda number=number: Int32(data=number))
    wait_until(lambda: heard == [1, 2, 3], "all but what was out of date")
    late = listen(ros, "late_listener")
    wait_until(lambda: late == [1, 2, 3], "what was published")
    node.destroy_node()


def test_a_message_that_cannot_be_made_is_not_tried_again(ros):
    node = Node("speaker", context=ros.context)
    topic = LazyPublisher(node, Int32, "numbers")
    topic.publish(lambda: 1 / 0)
    listen(ros)
    wait_until(lambda: topic.is_awaited, "the listener")
    with pytest.raises(ZeroDivisionError):
        topic.catch_up()
    assert not topic.is_awaited
    node.destroy_node()
