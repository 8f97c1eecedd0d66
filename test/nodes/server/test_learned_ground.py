# SPDX-License-Identifier: Apache-2.0
"""A traverse server takes what was learned of the ground; its answers say what they assume."""

import json
import time
from dataclasses import replace

import numpy as np
from std_msgs.msg import String
from std_srvs.srv import Trigger

from rover_planner.ros.guard import EVENT_PERIOD
from rover_planner.ros.qos import RESULT_QOS, TOPIC_QOS
from support.grounds import make_terrain, waves
from support.planner_client import GOAL, SERVER, START, ask
from support.ros_fixtures import call
from support.waiting import wait_until


def test_answers_say_which_ground_they_assume_and_since_when(start_server, client):
    server = start_server(planner="fan", learn="use")
    ground = make_terrain(waves)
    classes = np.full(ground.elevation.shape, 7.0)
    client.send_terrain(replace(ground, ground_class=classes))
    sender = client.create_publisher(String, f"{SERVER}/ground_estimate", TOPIC_QOS)
    assert ask(client)[1]["ground"] == "told"
    friction = {"mean": 0.5, "std": 0.05, "low": 0.4, "high": 0.6}
    learned = {"friction": friction, "classes": {"7": friction | {"mean": 0.45}}}
    bad = json.dumps({"friction": friction | {"mean": -1.0}})
    for text in ("no JSON", bad, json.dumps(learned)):
        client.send(sender, String(data=text))
    wait_until(lambda: server.service.snapshot().ground is not None, "the estimate")
    client.wait_for_log("ground_estimate not used: ~/ground_estimate: ")
    verdict = ask(client)[1]
    assert verdict["ground"] == "learned"
    assert float(verdict["ground_friction"]) == 0.5 and verdict["ground_since"]
    assert json.loads(verdict["ground_classes"].replace("'", '"')) == {"7": 0.45}


def test_places_marked_before_and_after_the_start_stay_impassable_until_they_are_cleared(
    start_server, client, capfd
):
    latched, sender = (
        client.create_publisher(String, f"{SERVER}/mark_place", qos)
        for qos in (RESULT_QOS, TOPIC_QOS)
    )
    place = {"x": GOAL[0], "y": GOAL[1], "radius": 0.3, "reason": "dust"}
    for date in ("before", "yesterday"):
        latched.publish(String(data=json.dumps(place | {"date": date})))
    server = start_server(planner="fan")
    client.send_terrain(make_terrain(waves))
    for text in ("no JSON", json.dumps(place | {"date": "today"})):
        client.send(sender, String(data=text))
    wait_until(lambda: len(server.service.marked.places) == 3, "the places")
    assert not client.can_traverse(START, GOAL).poses
    clearer = client.create_client(Trigger, f"{SERVER}/clear_places")
    assert call(clearer, Trigger.Request()).message == "3 marked places cleared"
    assert client.can_traverse(START, GOAL).poses
    time.sleep(2.0 * EVENT_PERIOD)
    assert "New publisher" not in capfd.readouterr().err  # that no message of it will be received
