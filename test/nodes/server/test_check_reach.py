# SPDX-License-Identifier: Apache-2.0
"""The traverse server answers over DDS whether the arm can reach and push, or says why not."""

import json
import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_srvs.srv import Trigger

from rover_physics.traversability.reach import judge_reach
from rover_planner.ros.qos import topic_qos
from support.grounds import make_terrain
from support.messages.tool_messages import make_target, make_wrench
from support.ros_fixtures import call
from support.waiting import wait_until

SERVER = "/traverse_server"
PATH = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.5]]
TARGET = (0.5, 0.3, 0.3)


class ToolClient:
    """The arm's side of a client: targets, wrenches and the question."""

    def __init__(self, client, server):
        self._server = server
        self._target = client.create_publisher(PoseStamped, f"{SERVER}/tool_target", topic_qos())
        self._wrench = client.create_publisher(WrenchStamped, f"{SERVER}/tool_wrench", topic_qos())
        self._check = client.create_client(Trigger, f"{SERVER}/check_reach")

    def send(self, target=None, wrench=None) -> None:
        """Publish messages, each as soon as the server hears it."""
        for publisher, message in ((self._target, target), (self._wrench, wrench)):
            if message is not None:
                wait_until(lambda p=publisher: p.get_subscription_count() > 0, "the server")
                publisher.publish(message)

    def aim(self, place) -> None:
        """Publish a target and wait until the server has it."""
        self.send(make_target(*place))
        reach = self._server.reach
        wait_until(lambda: np.array_equal(reach.query.target, place), "the target")

    def push(self, force, moment=(0.0, 0.0, 0.0)) -> None:
        """Publish a wrench and wait until the server has it."""
        self.send(wrench=make_wrench(force, moment))
        reach = self._server.reach
        wait_until(lambda: np.array_equal(reach.query.force, force), "the wrench")

    def ask(self) -> tuple[bool, dict]:
        """Ask; return success and the answer."""
        response = call(self._check, Trigger.Request())
        answer = json.loads(response.message)
        assert response.success == answer["possible"]
        return response.success, answer


@pytest.fixture
def tool(client, server):
    return ToolClient(client, server)


@pytest.fixture
def level(server, client):
    """Return a server with level ground and a path that ends at (0, 0, 0.5)."""
    client.send_terrain(make_terrain(lambda x, y: 0.0 * x))
    assert client.check_poses(server, PATH).success
    return server


def test_the_answer_is_that_of_the_model_at_the_end_of_the_path(level, tool):
    tool.aim((3.0, 0.0, 0.3))
    success, answer = tool.ask()
    assert not success and answer["code"] == "too_far" and answer["out_of_reach"] > 1.0
    tool.aim(TARGET)
    tool.push((3.0, 0.0, 5.0), (0.0, 0.5, 0.0))
    success, answer = tool.ask()
    expected = judge_reach(
        level.service.settings.rover,
        level.service.terrain,
        PATH[-1],
        TARGET,
        force=(3.0, 0.0, 5.0),
        moment=(0.0, 0.5, 0.0),
    ).to_dict()
    assert success and answer == json.loads(json.dumps(expected))


def test_soil_and_payload_of_the_server_count(level, client, tool):
    tool.aim(TARGET)
    loads = sum(tool.ask()[1]["wheel_loads"])
    assert client.set_parameter("payload", 2.0) == (True, "")
    assert client.set_parameter("soil", "dry_sand") == (True, "")
    answer = tool.ask()[1]
    assert sum(answer["wheel_loads"]) == pytest.approx(loads + 2.0 * 9.81)
    assert answer["max_sinkage"] > 0.001


def test_map_path_and_target_are_asked_for_in_turn(server, client, tool):
    assert tool.ask()[1]["code"] == "no_path"
    client.check_poses(server, PATH)
    assert tool.ask()[1]["code"] == "no_map"
    client.send_terrain(make_terrain(lambda x, y: 0.0 * x))
    assert tool.ask()[1]["code"] == "no_target"


def test_a_bad_message_is_not_answered_for_by_the_one_before(level, client, tool, ros):
    tool.aim(TARGET)
    assert tool.ask()[0]
    for target, text in [
        (make_target(frame="odom"), "tool target is in frame 'odom'"),
        (make_target(math.nan), "tool target is [nan"),
    ]:
        tool.send(target)
        client.wait_for_log(text)
        success, answer = tool.ask()
        assert not success and answer["code"] == "no_target" and text in answer["reason"]
    tool.aim(TARGET)
    for wrench, text in [
        (make_wrench(frame="base_link"), "tool wrench is in frame 'base_link'"),
        (make_wrench(force=(0.0, 0.0, math.inf)), "tool wrench force"),
    ]:
        tool.send(wrench=wrench)
        client.wait_for_log(text)
        success, answer = tool.ask()
        assert not success and answer["code"] == "no_wrench" and text in answer["reason"]
    tool.push((0.0, 0.0, 0.0))
    assert tool.ask()[0]
    assert ros.is_alive(level)
