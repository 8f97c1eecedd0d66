# SPDX-License-Identifier: Apache-2.0
"""The monitor stops the rover in time over real DDS and says why."""

import threading
import time
from statistics import median

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_srvs.srv import SetBool

from msg_adapters.identity import path_hash
from rover_planner.nodes.navigation.path_watch import PathWatch
from support.grounds import make_terrain, wall_at, waves
from support.planner_client import GOAL, SERVER, START, begin_plan
from support.ros_fixtures import call, hear
from support.waiting import wait_until

WATCHFUL = {"planner": "fan", "candidate_count": 1, "monitor_timeout": 60.0}
"""Parameters; a busy machine may keep the pose from the server for more than the usual second."""
FREE, BLOCKED = make_terrain(waves), make_terrain(wall_at(1.05))
"""Ground on which the way from START to GOAL is passable, and one with a wall across it."""


@pytest.fixture
def watching(start_server, client):
    """Return a server that watches the way from START to GOAL of a rover at START."""
    server = start_server(monitor=True, **WATCHFUL)
    client.stand(START)
    client.send_terrain(FREE)
    wait_until(lambda: server.service.fresh_pose() is not None, "odometry")
    client.wait_for_stop()  # no path was accepted yet
    plan, _ = client.next_results(lambda: client.can_traverse(START, GOAL))
    assert plan.poses
    wait_until(lambda: server.watch.finding.state == "watching", "the watch")
    client.wait_for_stop(False)
    return server


def time_stop(client) -> float:
    """Put a wall across the path; return the time until the stop is heard [s]."""
    sent = time.monotonic()
    client.send_terrain(BLOCKED)
    client.wait_for_stop()
    return next(at for stops, at in client.stops if stops and at > sent) - sent


def test_a_wall_put_across_the_path_stops_the_rover_and_the_verdict_says_why(watching, client):
    told = hear(client, DiagnosticArray, "diagnostics")
    client.heard["verdict"].clear()
    time_stop(client)
    verdict = client.wait_for_verdict()
    assert verdict["service"] == "monitor" and verdict["traversable"] == "false"
    assert " m ahead: " in verdict["reason"]
    assert verdict["map_hash"] == watching.service.known_map.fingerprint
    # The way from the front wheel at the start to the wall.
    assert 2.0 < float(verdict["failure_distance"]) < 3.0
    level, reason = DiagnosticStatus.ERROR, verdict["reason"]

    def is_told() -> bool:
        found = [one for message in told for one in message.status if reason in one.message]
        return any(one.level == level and one.name.endswith(": monitor") for one in found)

    wait_until(is_told, "the stop in the diagnostics")


def test_the_stop_is_a_heartbeat_with_the_path_and_the_age_of_the_map(watching, client):
    told = hear(client, DiagnosticStatus, f"{SERVER}/watch")
    wait_until(lambda: len(told) > 3, "the state of the watch")
    values = {one.key: one.value for one in told[-1].values}
    assert values["path_hash"] == watching.watch.finding.path_hash
    assert 0.0 < float(values["map_age"].removesuffix(" s")) < 60.0
    go_on = threading.Event()
    watching.watch._look = lambda *given: go_on.wait(60.0) and watching.watch.finding
    wait_until(lambda: client.silence > 0.5, "silence of a watch that hangs")
    go_on.set()
    wait_until(lambda: client.silence < 0.2, "the heartbeat")


def test_a_busy_node_does_not_delay_the_heartbeat_and_one_that_hangs_ends_it(watching, client):
    urgent = [
        one.name for one in threading.enumerate() if one.native_id in watching.urgent_threads
    ]
    assert urgent == ["heartbeat"]
    is_held, go_on = threading.Event(), threading.Event()
    watching.handover.call(lambda: is_held.set() or go_on.wait(60.0))
    assert is_held.wait(20.0)
    before = len(client.stops)
    wait_until(lambda: len(client.stops) > before + 3, "the heartbeat of a busy node")
    wait_until(lambda: client.silence > 0.5, "silence of a node that hangs")
    go_on.set()
    wait_until(lambda: client.silence < 0.2, "the heartbeat")


@pytest.mark.timed
def test_the_rover_stops_in_half_a_second_while_a_question_is_in_work(
    watching, client, ros, endless
):
    delays = []
    for _ in range(3):
        with endless():
            _, future = begin_plan(ros, START, (3.0, 0.5, 0.0))
            wait_until(lambda: watching.desk.open_count == 1, "the question")
            time.sleep(0.2)
            delays.append(time_stop(client))
            assert not future.done()
            watching.desk.cancel("cancelled", "the question has lasted long enough")
        client.send_terrain(FREE)
        assert client.can_traverse(START, GOAL).poses
        client.wait_for_stop(False)
    assert median(delays) < 0.5, delays  # a machine that stops for a moment delays one of them


def test_a_path_is_not_judged_by_what_was_known_before_it_was_accepted(
    watching, client, monkeypatch, hold
):
    client.send_terrain(BLOCKED)
    client.wait_for_stop()
    is_held, go_on = hold(PathWatch, "_look")
    assert is_held.wait(20.0), "a look"
    wait_until(lambda: watching.watch._sight is not None, "what the next look is to look at")
    with monkeypatch.context() as blind:
        blind.setattr(watching.watch, "_offer_sight", lambda: None)
        client.send_terrain(FREE)
        assert client.can_traverse(START, GOAL).poses
        go_on.set()
        time.sleep(0.3)
    client.wait_for_stop(False)


def test_the_service_turns_the_monitor_on_and_off(watching, client):
    switch = client.create_client(SetBool, f"{SERVER}/monitor")
    client.send_terrain(BLOCKED)
    client.wait_for_stop()
    assert call(switch, SetBool.Request(data=False)).success
    client.wait_for_stop(False)
    client.send_terrain(FREE)
    plan = client.can_traverse(START, GOAL)
    assert call(switch, SetBool.Request(data=True)).success
    assert watching.get_parameter("monitor").value is True
    wait_until(lambda: watching.watch.finding.state == "watching", "the watch")
    assert watching.watch.finding.path_hash == path_hash(plan)
