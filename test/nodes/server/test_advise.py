# SPDX-License-Identifier: Apache-2.0
"""~/advise answers over DDS about the path that was refused last, and gives way to questions."""

import json
from concurrent.futures import Future

from std_msgs.msg import String
from std_srvs.srv import Trigger

from rover_planner.advice import seek
from rover_planner.advice.advise import STOPPED
from rover_planner.advice.levers import LEVERS
from rover_planner.ros.qos import LATCHED_QOS
from support.grounds import make_terrain, rock_left
from support.planner_client import SERVER, begin_plan
from support.ros_fixtures import call, hear
from support.waiting import wait_until

START, GOAL = (-1.0, 0.0, 0.0), (1.2, 0.0, 0.0)


def send_request(client, name) -> Future:
    service = client.create_client(Trigger, f"{SERVER}/{name}")
    assert service.wait_for_service(20.0)
    return service.call_async(Trigger.Request())


def test_advice_is_about_the_path_that_was_refused_last(start_server, client, ros, monkeypatch):
    few = [one for one in LEVERS if one.name in ("policy", "shift", "curve")]
    monkeypatch.setattr(seek, "LEVERS", few)
    start_server(planner="fan", candidate_count=1, advice_time=60.0)
    advise = client.create_client(Trigger, f"{SERVER}/advise")
    grown = hear(client, String, f"{SERVER}/advice", LATCHED_QOS)
    assert json.loads(call(advise, Trigger.Request()).message)["code"] == "no_path"
    client.send_terrain(make_terrain(rock_left))
    assert not client.can_traverse(START, GOAL).poses
    response = call(advise, Trigger.Request())
    advice = json.loads(response.message)
    assert response.success and advice["complete"] and advice["code"] == "belly"
    assert any("poses" in one for one in advice["remedies"])
    wait_until(lambda: grown and grown[-1].data == response.message, "the same on the topic")
    told = [json.loads(one.data) for one in grown]
    counts = [len(one["remedies"]) + len(one["others"]) for one in told]
    assert counts == sorted(counts)


def test_advice_gives_way_to_questions_and_ends_when_its_time_is_up_or_it_is_cancelled(
    start_server, client, ros, endless
):
    server = start_server(planner="fan", candidate_count=1, advice_time=0.5, time_budget=600.0)
    client.send_terrain(make_terrain(rock_left))
    assert not client.can_traverse(START, GOAL).poses
    with endless():  # a question that lasts
        _, question = begin_plan(ros, START, GOAL)
        wait_until(lambda: server.desk.open_count == 1, "the question")
        advice = send_request(client, "advise")
        wait_until(advice.done, "the end of its time")
        answer = json.loads(advice.result().message)
        assert (answer["code"], answer["reason"]) == ("too_long", STOPPED)
        assert client.set_parameter("advice_time", 600.0) == (True, "")
        advice, busy = send_request(client, "advise"), send_request(client, "advise")
        wait_until(busy.done, "the refusal of the second")
        assert json.loads(busy.result().message)["code"] == "busy"
        assert not advice.done()
        cancel = send_request(client, "cancel")
        wait_until(cancel.done, "the answer")
        assert cancel.result().message.startswith("2 ")
    wait_until(advice.done, "the end of the advice")
    assert json.loads(advice.result().message)["code"] == "cancelled"
    wait_until(question.done, "the end of the question")
