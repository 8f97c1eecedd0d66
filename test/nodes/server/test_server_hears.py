# SPDX-License-Identifier: Apache-2.0
"""A traverse server hears parameters, maps, cancels and signals while it works on a question."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from msg_adapters.identity import path_hash, plan_request_hash
from rover_physics import load_rover
from rover_physics.names import WHEEL_JOINTS
from rover_planner.ros.node import RoverNode
from support.grounds import make_terrain, raised, wall_at, waves
from support.planner_client import GOAL, SERVER, START, begin_plan, verdict_of
from support.ros_fixtures import call, hear, run_in_executor
from support.waiting import wait_until


def test_parameters_maps_and_a_cancel_are_served_while_a_question_is_in_work(
    start_server, client, ros, endless
):
    server = start_server(time_budget=600.0)
    client.send_terrain(make_terrain(waves))
    first = server.service.known_map.fingerprint
    service = client.create_client(Trigger, f"{SERVER}/cancel")
    with endless():
        _, future = begin_plan(ros)
        wait_until(lambda: server.desk.open_count == 1, "the question")
        assert client.set_parameter("friction", 0.7) == (True, "")
        client.send_terrain(make_terrain(wall_at(0.5)))
        assert not future.done() and server.desk.open_count == 1
        answer = call(service, Trigger.Request())
    assert answer.success and answer.message == "1 open questions cancelled"
    wait_until(future.done, "the answer")
    assert future.result().plan.poses == []
    verdict = client.wait_for_verdict()
    assert verdict["code"] == "cancelled"
    assert verdict["map_hash"] == first != server.service.known_map.fingerprint
    assert not call(service, Trigger.Request()).success


def test_a_server_that_ends_refuses_an_open_question_at_once(
    start_server, client, ros, endless, monkeypatch
):
    monkeypatch.setattr(RoverNode, "destroy_node", lambda _: None)  # the answer is to leave yet
    server = start_server(time_budget=600.0)
    client.send_terrain(make_terrain(waves))
    with endless():
        _, future = begin_plan(ros)
        wait_until(lambda: server.desk.open_count == 1, "the question")
        began = time.monotonic()
        run_in_executor(server, server.destroy_node)
        assert time.monotonic() - began < 1.5
    wait_until(future.done, "the answer")
    assert future.result().plan.poses == []


def test_stamps_of_answers_differ_even_while_the_clock_is_paused(start_server, client):
    server = start_server(use_sim_time=True, planner="fan")
    server.service.take_terrain(make_terrain(waves))
    plans = [client.can_traverse(START, GOAL) for _ in range(3)]
    stamps = [plan.header.stamp.nanosec for plan in plans]
    assert stamps == sorted(set(stamps)) and {plan.header.stamp.sec for plan in plans} == {0}


def test_joints_that_are_sent_seldom_are_heard_beside_those_of_a_fast_publisher(
    start_server, client
):
    server = start_server(planner="fan")
    arm = load_rover("lsr1").manipulator.joints
    client.send_joints(arm, [0.1, 0.2, 0.3])
    for _ in range(100):
        client.send_joints(WHEEL_JOINTS, [0.0] * 6)
    time.sleep(0.1)
    client.can_traverse(START, GOAL)
    assert [server.service.joints[name] for name in arm] == [0.1, 0.2, 0.3]


def test_diagnostics_tell_what_is_wrong_and_a_no_is_not_an_error(start_server, client):
    server = start_server(planner="fan")
    heard = hear(client, DiagnosticArray, "diagnostics")

    def wait_for(level, text) -> dict[str, str]:
        def find_told():
            last = heard[-1] if heard else DiagnosticArray(status=[DiagnosticStatus(level=b"9")])
            is_told = last.status[0].level == level and text in str(last)
            return verdict_of(last) if is_told else None

        return wait_until(find_told, f"a status of level {level} with {text!r}")

    wait_for(DiagnosticStatus.WARN, "no map")
    client.send_terrain(make_terrain(wall_at(0.5)))
    assert client.can_traverse(START, GOAL).poses == []
    values = wait_for(DiagnosticStatus.OK, "1, can_traverse")
    assert values["map"] == "elevation_cloud" and float(values["last latency [ms]"]) > 0.0
    server.guard.report("a test", ZeroDivisionError("made up"))
    wait_for(DiagnosticStatus.ERROR, "ZeroDivisionError")


def test_parameters_of_cells_and_gaps_act_on_the_map_that_is_there(start_server, client):
    server = start_server(max_gap=0.5)
    client.send_terrain(raised(make_terrain(waves), np.s_[80:82, 80:82], np.nan))
    changed = {"map_resolution": 0.05, "unknown_cells": "interpolate"}
    changes = [Parameter(name, value=value) for name, value in changed.items()]
    assert run_in_executor(server, lambda: server.set_parameters_atomically(changes)).successful
    wait_until(lambda: np.isfinite(server.service.terrain.elevation).all(), "the gap filled")
    assert client.set_parameter("map_resolution", 0.1)[0]
    wait_until(lambda: server.service.terrain.resolution == pytest.approx(0.1), "the new cells")


def test_each_client_can_tell_its_own_verdict(shared):
    client = shared.client
    client.heard["verdict"].clear()
    requests = [begin_plan(shared.ros, goal=(1.0 + 0.1 * k, 0.0, 0.0)) for k in range(3)]
    for _, future in requests:
        wait_until(future.done, "the answers")
    told = client.heard["verdict"]
    wait_until(lambda: len(told) == len(requests), "the verdicts")
    verdicts = [verdict_of(one) for one in told]
    numbers = [int(verdict["request"]) for verdict in verdicts]
    assert numbers == sorted(set(numbers))
    assert len({verdict["server"] for verdict in verdicts}) == 1
    by_hash = {verdict["question_hash"]: verdict for verdict in verdicts}
    for request, future in requests:
        verdict = by_hash[plan_request_hash(request.start, request.goal, request.tolerance)]
        plan = future.result().plan
        assert verdict["path_hash"] == path_hash(plan)
        stamp = f"{plan.header.stamp.sec}.{plan.header.stamp.nanosec:09d}"
        assert verdict["path_stamp"] == stamp
