# SPDX-License-Identifier: Apache-2.0
"""Maps are heard whenever and however they are published, or who cannot be heard is named."""

import time
from functools import partial

import pytest
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.node import RoverNode
from rover_planner.ros.qos import LATCHED_QOS, make_qos
from rover_planner.ros.subscriptions import subscribe_to_map
from support.waiting import repeat_until, wait_until

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.fixture
def hear(ros):
    """Return a function that starts a node with parameters; it returns the maps it hears."""

    def start(**values):
        heard: list[bytes] = []
        node = ros.start(partial(RoverNode, "hearer", TraverseServerParameters), **values)
        node.create_timer(0.1, lambda: None)  # as nodes have: a mismatch wakes no executor
        subscribe_to_map(node, PointCloud2, "maps", heard.append)
        return heard

    return start


@pytest.fixture
def advertise(ros):
    """Return a function that makes a publisher of maps with a profile."""
    speaker = ros.spin(Node("speaker", context=ros.context))
    return lambda qos: speaker.create_publisher(PointCloud2, "maps", qos)


@pytest.mark.parametrize(
    ("values", "qos"),
    [
        ({}, make_qos(1)),
        ({"input_reliability": "best_effort"}, BEST_EFFORT),
    ],
)
def test_volatile_maps_and_where_the_parameter_says_so_best_effort_ones_are_heard(
    advertise, hear, values, qos
):
    heard, publisher = hear(**values), advertise(qos)
    repeat_until(lambda: publisher.publish(PointCloud2()), lambda: heard, "the map")


def test_a_map_is_not_heard_again_when_a_silent_publisher_comes(advertise, hear):
    publisher = advertise(LATCHED_QOS)
    publisher.publish(PointCloud2(width=1))  # before who hears it has started
    heard = hear()
    wait_until(lambda: heard, "the map")
    wait_until(lambda: publisher.get_subscription_count() == 2, "both subscriptions")
    silent = advertise(make_qos(1))
    wait_until(lambda: silent.get_subscription_count() == 1, "the volatile subscription")
    time.sleep(0.5)
    assert len(heard) == 1
    repeat_until(lambda: silent.publish(PointCloud2()), lambda: len(heard) > 1, "the other map")


def test_a_best_effort_publisher_is_named_with_the_parameter_that_mends_it(advertise, hear, capfd):
    hear()
    advertise(BEST_EFFORT)
    text = "a publisher of maps is not heard: its reliability does not match; "
    text += "set input_reliability to best_effort"
    told: list[str] = []
    repeat_until(
        lambda: told.append(capfd.readouterr().err), lambda: text in "".join(told), "the warning"
    )
