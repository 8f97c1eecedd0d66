# SPDX-License-Identifier: Apache-2.0
"""The traverse server answers over DDS, and says why not."""

import json
import math
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.srv import GetPlan

from msg_adapters.paths import path_to_poses, stamped_pose
from msg_adapters.results.predictions import array_values
from rover_physics.traversability.classification import PASSABLE
from rover_planner.nodes.result_topics import WHEEL_TOPICS
from rover_planner.planning.answering.budget import TOO_LONG
from rover_planner.planning.answering.judgement import refusal
from rover_planner.planning.answering.questions import PathQuestion
from rover_planner.planning.navigation.transforms import Rigid
from support.grounds import make_terrain, waves
from support.messages import send_map_odom
from support.planner_client import GOAL, START, PlannerClient, ask, begin_plan
from support.ros_fixtures import run_in_executor
from support.waiting import wait_until

AHEAD = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def check(client, server, poses=AHEAD) -> dict:
    return json.loads(client.check_poses(server, poses).message)


def test_who_comes_after_the_answer_hears_all_results(start_server, ros):
    server = start_server(planner="fan")
    server.service.take_terrain(make_terrain(waves))
    _, future = begin_plan(ros)
    wait_until(future.done, "the answer")
    wait_until(lambda: not server.handover._waiting, "the results, which nobody hears yet")
    late = ros.spin(PlannerClient(ros)).heard
    wait_until(lambda: all(late.values()), "all results")
    assert late["plan"] == [future.result().plan]


def test_a_plan_has_a_pose_where_the_class_changes(start_server, client):
    server = start_server(policy="optimal", plan_spacing=50.0, candidate_count=1)
    client.send_terrain(make_terrain(lambda x, y: 0.45 * np.maximum(x - 0.13, 0.0)))
    plan = client.can_traverse((-1.5, 0.0, 0.0), (1.5, 0.0, 0.0))
    verdict = check(client, server, [[-1.5, 0.0, 0.0], [1.5, 0.0, 0.0]])
    classes = np.array(verdict["traversability_classes"])
    changes = np.flatnonzero(classes[1:] != classes[:-1]) + 1
    assert len(changes) and len(plan.poses) == 2 + len(changes)
    found = [pose.pose.position.x for pose in plan.poses[1:-1]]
    np.testing.assert_allclose(found, -1.5 + 0.05 * changes, atol=1e-9)


def test_start_and_goal_on_the_map_are_placed_by_tf(start_server, client):
    server = start_server(map_frame="odom", transform_timeout=30.0)
    map_odom = Rigid.from_rpy(30.0, -12.0, 0.4, 0.0, 0.0, 2.2)
    send_map_odom(server, map_odom)
    start, goal = (
        stamped_pose(map_odom.then(Rigid.from_rpy(x, y, 0.0, 0.0, 0.0, yaw)).xyyaw, "map")
        for x, y, yaw in (START, GOAL)
    )
    question = server.read_question(GetPlan.Request(start=start, goal=goal))
    np.testing.assert_allclose([question.start, question.goal], [START, GOAL], atol=1e-9)
    assert client.plan(start, goal).header.frame_id == "odom"


def test_a_passable_goal_gets_a_plan_and_the_results_of_the_model_with_one_stamp(shared):
    plan, verdict, results = ask(shared.client)
    assert verdict["traversable"] == "true" and verdict["reason"] == ""
    assert verdict["traversability_class"] == PASSABLE and "codes" not in verdict
    poses = path_to_poses(plan, "map")
    np.testing.assert_allclose(poses[[0, -1]], [START, GOAL], atol=1e-9)
    answer = shared.server.service.snapshot().answer(np.array(START), np.array(GOAL))
    expected = answer.candidate.prediction
    for topic, field in WHEEL_TOPICS.items():
        np.testing.assert_array_equal(array_values(results[topic]), getattr(expected, field))
    assert float(verdict["energy"]) == pytest.approx(expected.energy[-1])
    headers = [results[topic].header for topic in ("plan", "predicted_joints", "verdict")]
    headers += [marker.header for marker in results["markers"].markers]
    headers += [pose.header for pose in plan.poses]
    assert all(header == plan.header for header in headers)
    assert plan.header.frame_id == "map" and plan.header.stamp.sec > 0


def test_check_path_answers_in_json_with_all_results_and_says_why_not(shared):
    server, client = shared.server, shared.client
    answer, results = client.next_results(lambda: client.check_poses(server, AHEAD))
    verdict = json.loads(answer.message)
    assert answer.success and verdict["traversable"] and verdict["first_failure"] == -1
    assert verdict["length"] == pytest.approx(2.0) and len(verdict["codes"]) == 41
    assert len(results["plan"].poses) == 21
    assert results["verdict"].status[0].level == DiagnosticStatus.OK

    verdict = check(client, server, [[3.0, 0.0, 0.0], [6.0, 0.0, 0.0]])
    assert verdict["traversable"] is False and verdict["code"] == "off_map" and verdict["reason"]
    assert verdict["class_constraint"] == "off_map" and verdict["class_margin"] is None


def test_results_are_those_of_the_rover_of_the_question(shared):
    """Angles of a path of one rover had the wheel radius of the next one."""
    server = shared.server
    assert shared.client.set_parameter("rover", "m2020") == (True, "")
    known, question = server.service.snapshot(), PathQuestion(START, GOAL)
    about = server.desk.register.identify("can_traverse", question, known)
    assert shared.client.set_parameter("rover", "lsr1") == (True, "")
    results = run_in_executor(server, lambda: server.publish(question.judge(known), about))
    assert results.rover is known.settings.rover
    assert results.verdict().status[0].hardware_id == "m2020"


def test_the_measured_suspension_raises_a_warning_where_it_disagrees(shared, lasting):
    server, client = shared.server, shared.client
    client.send_joints(["camera", "rocker_left"], [math.nan, 0.5])
    wait_until(lambda: server.service.joints, "the joints")
    client.stand((-0.5, 0.0, 0.0))
    standing = server.service.snapshot
    wait_until(lambda: standing().measured_pose is not None, "the odometry")
    answer, results = client.next_results(lambda: client.check_poses(server, AHEAD))
    verdict = json.loads(answer.message)
    assert answer.success and not verdict["suspension_agrees"]
    assert verdict["suspension_mismatch"]["rocker_left"] == pytest.approx(0.5, abs=0.05)
    assert results["verdict"].status[0].level == DiagnosticStatus.WARN


def test_questions_without_a_pause_do_not_put_off_the_refusal_of_one_that_hangs(start_server):
    server, go_on, codes = start_server(time_budget=0.2), threading.Event(), []
    hangs = SimpleNamespace(hash="", judge=lambda _: refusal("", f"{go_on.wait(60.0)}"))

    def ask_again():
        server.desk.ask("check_path", hangs, lambda answer: codes.append(answer.judgement.code))

    wait_until(lambda: server.handover.call(ask_again) or TOO_LONG in codes, "the refusal", 5.0)
    go_on.set()
