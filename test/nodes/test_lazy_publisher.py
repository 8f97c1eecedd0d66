"""A message is made only for those who listen, and whoever comes later gets the latest."""

import pytest
from rclpy.node import Node
from std_msgs.msg import Int32

from rover_planner.ros.publishing.lazy_publisher import LazyPublisher
from rover_planner.ros.qos import result_qos
from support.waiting import wait_until


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


def test_listeners_hear_all_in_order_and_late_ones_the_latest(ros):
    node = Node("speaker", context=ros.context)
    topic = LazyPublisher(node, Int32, "numbers")
    topic.publish(lambda: Int32(data=0))
    heard = listen(ros)
    wait_until(lambda: topic.is_awaited, "the listener")
    for number in range(1, 4):
        topic.publish(lambda number=number: Int32(data=number))
    wait_until(lambda: heard == [1, 2, 3], "all but what was out of date")
    late = listen(ros, "late_listener")
    wait_until(lambda: late == [3], "the latest alone")
    node.destroy_node()


def test_whoever_comes_after_a_listener_has_left_never_gets_what_is_out_of_date(ros):
    node = Node("speaker", context=ros.context)
    topic = LazyPublisher(node, Int32, "numbers")
    visitor, seen = Node("visitor", context=ros.context), []
    visitor.create_subscription(
        Int32, "numbers", lambda number: seen.append(number.data), result_qos()
    )
    ros.spin(visitor)
    wait_until(lambda: node.count_subscribers("numbers") == 1, "the visitor")
    wait_until(lambda: topic._publisher.has_listeners, "its match")
    topic.publish(lambda: Int32(data=1))
    wait_until(lambda: seen == [1], "the first")
    visitor.destroy_node()
    wait_until(lambda: not topic._publisher.has_listeners, "the leave")
    topic.publish(lambda: Int32(data=2))
    heard = listen(ros)

    def catch_up():
        topic.catch_up()
        return heard

    wait_until(catch_up, "the latest")
    assert heard == [2]
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
