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
        arm = self._server.arm
        wait_until(lambda: np.array_equal(arm.query.target, place), "the target")

    def push(self, force, moment=(0.0, 0.0, 0.0)) -> None:
        """Publish a wrench and wait until the server has it."""
        self.send(wrench=make_wrench(force, moment))
        arm = self._server.arm
        wait_until(lambda: np.array_equal(arm.query.force, force), "the wrench")

    def ask(self) -> tuple[bool, dict]:
        """Ask; return success and the answer."""
        response = call(self._check, Trigger.Request())
        answer = json.loads(response.message)
        assert response.success == answer["possible"]
        return response.success, answer


@pytest.fixture
def tool(client, server):
    return ToolClient(client, server)


def test_what_is_missing_is_asked_for_in_turn_then_the_answer_is_that_of_the_model(
    server, client, tool, ros
):
    assert tool.ask()[1]["code"] == "no_path"
    client.check_poses(server, PATH)
    assert tool.ask()[1]["code"] == "no_map"
    client.send_terrain(make_terrain(lambda x, y: 0.0 * x))
    assert tool.ask()[1]["code"] == "no_target"
    tool.aim((3.0, 0.0, 0.3))
    success, answer = tool.ask()
    assert not success and answer["code"] == "too_far" and answer["out_of_reach"] > 1.0
    tool.aim(TARGET)
    tool.push((3.0, 0.0, 5.0), (0.0, 0.5, 0.0))
    success, answer = tool.ask()
    expected = judge_reach(
        server.service.settings.rover,
        server.service.terrain,
        PATH[-1],
        TARGET,
        force=(3.0, 0.0, 5.0),
        moment=(0.0, 0.5, 0.0),
    ).to_dict()
    assert success and answer == json.loads(json.dumps(expected))
    # A bad message is not answered for by the one before.
    tool.send(make_target(math.nan))
    client.wait_for_log("tool target is [nan")
    success, answer = tool.ask()
    assert not success and answer["code"] == "no_target" and "[nan" in answer["reason"]
    tool.aim(TARGET)
    tool.send(wrench=make_wrench(force=(0.0, 0.0, math.inf)))
    client.wait_for_log("tool wrench force")
    success, answer = tool.ask()
    assert not success and answer["code"] == "no_wrench" and "force" in answer["reason"]
    tool.push((0.0, 0.0, 0.0))
    assert tool.ask()[0]
    assert ros.is_alive(server)
