# SPDX-License-Identifier: Apache-2.0
"""The traverse server answers over DDS whether the arm can reach and push, or says why not."""

import json
import math

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_srvs.srv import Trigger

from rover_physics import judge_reach
from rover_planner.ros.qos import TOPIC_QOS
from support.grounds import make_terrain
from support.messages import make_target, make_wrench
from support.planner_client import SERVER
from support.ros_fixtures import call
from support.waiting import wait_until

PATH = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.5]]
TARGET, FORCE, MOMENT = (0.5, 0.3, 0.3), (3.0, 0.0, 5.0), (0.0, 0.5, 0.0)


def test_what_is_missing_is_asked_for_in_turn_then_the_answer_is_that_of_the_model(
    server, client, ros
):
    targets = client.create_publisher(PoseStamped, f"{SERVER}/tool_target", TOPIC_QOS)
    wrenches = client.create_publisher(WrenchStamped, f"{SERVER}/tool_wrench", TOPIC_QOS)
    check, arm = client.create_client(Trigger, f"{SERVER}/check_reach"), server.arm

    def ask() -> dict:
        response = call(check, Trigger.Request())
        answer = json.loads(response.message)
        assert response.success == answer["possible"]
        return answer

    def aim(place) -> None:
        client.send(targets, make_target(*place))
        wait_until(lambda: np.array_equal(arm.query.target, place), "the target")

    assert ask()["code"] == "no_path"
    client.check_poses(server, PATH)
    assert ask()["code"] == "no_map"
    client.send_terrain(make_terrain(lambda x, y: 0.0 * x))
    assert ask()["code"] == "no_target"
    aim(TARGET)
    client.send(wrenches, make_wrench(FORCE, MOMENT))
    wait_until(lambda: np.array_equal(arm.query.force, FORCE), "the wrench")
    rover, terrain = server.service.settings.rover, server.service.terrain
    expected = judge_reach(rover, terrain, PATH[-1], TARGET, force=FORCE, moment=MOMENT)
    assert expected.possible and ask() == json.loads(json.dumps(expected.to_dict()))
    # A bad message is not answered for by the one before.
    client.send(targets, make_target(math.nan))
    client.wait_for_log("tool target is [nan")
    assert ask()["code"] == "no_target"
    aim(TARGET)
    client.send(wrenches, make_wrench(force=(0.0, 0.0, math.inf)))
    client.wait_for_log("tool wrench force")
    answer = ask()
    assert answer["code"] == "no_wrench" and "force" in answer["reason"]
    client.send(wrenches, make_wrench((0.0, 0.0, 0.0)))
    wait_until(lambda: arm.query.force is not None, "the wrench")
    assert ask()["possible"]
