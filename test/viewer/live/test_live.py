# SPDX-License-Identifier: Apache-2.0
"""The page follows a live graph: it shows what a rover, its server and controller publish."""

import json
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from msg_adapters.commands import labelled_array
from msg_adapters.paths import poses_path
from msg_adapters.results.predictions import waypoint_array
from rover_physics.names import WHEEL_JOINTS
from rover_planner.errors import PlanningError
from rover_planner.planning.learned_ground import LearnedGround
from rover_planner.ros.qos import LATCHED_QOS, RESULT_QOS, SENSOR_QOS, TOPIC_QOS
from rover_planner.viewer.live.listener import LiveListener, listen
from rover_planner.viewer.live.live_state import (
    CLICK,
    MAX_AGE,
    MAX_TRAIL,
    PATIENCE,
    SIGN_OF_LIFE,
    TRAIL_STEP,
    LiveData,
    LiveQuestion,
    TopicAge,
    add_to_trail,
    choose_answer,
    describe_learned,
    read_state,
)
from support.messages import odometry_at
from support.paths import poses_at
from support.rovers import LSR1
from support.waiting import repeat_until, wait_until


@pytest.fixture
def listener(ros) -> LiveListener:
    return ros.spin(LiveListener(context=ros.context))


@pytest.fixture
def talker(ros, listener) -> SimpleNamespace:
    """What publishes the topics of a rover, its server and its controller."""
    node = Node("talker", context=ros.context)
    topics = {
        "joints": (JointState, "joint_states", SENSOR_QOS),
        "odometry": (Odometry, "odometry", SENSOR_QOS),
        "verdict": (DiagnosticArray, "/traverse_server/verdict", RESULT_QOS),
        "plans": (Path, "/traverse_server/plan", RESULT_QOS),
        "predicted": (Float64MultiArray, "/traverse_server/wheel_loads", RESULT_QOS),
        "estimates": (String, "/traverse_server/ground_estimate", LATCHED_QOS),
        "estimated": (Float64MultiArray, "/traction_controller/wheel_loads", TOPIC_QOS),
    }
    made = {name: node.create_publisher(*topic) for name, topic in topics.items()}
    ros.spin(node)
    wait_until(lambda: made["odometry"].get_subscription_count() == 1, "the listener")
    return SimpleNamespace(**made)


def odometry(x=1.0, y=2.0) -> Odometry:
    message = odometry_at((x, y, 0.0), height=0.3)
    message.twist.twist.linear.x = 0.05
    return message


def publish_until(publisher, message, condition, what: str) -> None:
    """Publish a message again and again, until it has had its effect."""
    repeat_until(lambda: publisher.publish(message), condition, what)


def has_place(listener) -> bool:
    return listener.latest().position is not None


def test_the_state_has_the_measured_joints(listener, talker):
    angles = {"rocker_right": 0.1, "rocker_left": -0.1, "bogie_right": 0.2, "bogie_left": -0.05}
    state = JointState(name=[*angles, *WHEEL_JOINTS])
    state.position = [*angles.values(), *np.arange(6.0).tolist()]
    repeat_until(
        lambda: (talker.joints.publish(state), talker.odometry.publish(odometry())),
        lambda: len(listener.latest().joints) == 10 and listener.latest().speed,
        "joints and odometry",
    )
    state = read_state(LSR1, listener.latest())
    assert state is not None
    np.testing.assert_allclose(state.position, [1.0, 2.0, 0.3])
    np.testing.assert_allclose(state.rocker_angle, [0.1, -0.1])
    np.testing.assert_allclose(state.bogie_angle, [0.2, -0.05])
    np.testing.assert_allclose(state.spin, np.arange(6.0))
    assert state.motion[0] == 0.05


def test_the_energy_is_torque_times_rate_times_time(listener, talker):
    def state(second: int) -> JointState:
        message = JointState(name=list(WHEEL_JOINTS))
        message.position = [0.0] * 6
        message.velocity, message.effort = [0.5] * 6, [1.0] * 6
        message.header.stamp.sec = second
        return message

    publish_until(talker.joints, state(10), lambda: listener.latest().efforts, "the first state")
    unknown = state(11)
    unknown.velocity[0] = float("nan")  # as of a joint without a sensor
    publish_until(talker.joints, unknown, lambda: listener.latest().time == 1.0, "a second")
    assert listener.latest().energy == pytest.approx(5 * 0.5 * 1.0)
    publish_until(talker.joints, state(13), lambda: listener.latest().time == 3.0, "two seconds")
    assert listener.latest().energy == pytest.approx(5 * 0.5 * 1.0 + 6 * 0.5 * 1.0 * 2.0)


def test_estimates_take_precedence_over_predictions_and_forces_end_with_their_source(
    listener, talker
):
    life = DiagnosticArray(status=[DiagnosticStatus(message="a wheel slips")])
    talker.predicted.publish(waypoint_array(np.full((3, 6), 7.0)))
    talker.plans.publish(poses_path(poses_at([0.0, 1.0, 2.0]), "map"))
    repeat_until(
        lambda: (talker.verdict.publish(life), talker.odometry.publish(odometry())),
        lambda: "server" in listener.latest().forces_from,
        "predictions",
    )
    loads, received = np.arange(10.0, 16.0), []

    def is_estimated() -> bool:
        received.append(listener.latest())
        return "controller" in received[-1].forces_from

    publish_until(talker.estimated, labelled_array(loads, "wheel"), is_estimated, "the controller")
    np.testing.assert_allclose(received[-1].forces["wheel_loads"], loads)
    wait_until(lambda: not listener.latest().forces_from, "both to count as silent")
    assert not listener.latest().forces and listener.latest().plan is not None


def test_what_is_invalid_or_missing_is_unknown_and_plans_are_refused(ros, listener, talker):
    assert read_state(LSR1, listener.latest()) is None
    assert listener.latest().terrain is None and listener.latest().newest is None
    with pytest.raises(PlanningError, match="odometry"):
        listener.request_plan(np.zeros(2))
    broken = JointState(name=["rocker_right"], position=[float("nan")])
    talker.joints.publish(broken)
    talker.odometry.publish(odometry(x=float("inf")))
    talker.estimated.publish(Float64MultiArray(data=[1.0]))
    publish_until(talker.odometry, odometry(), lambda: has_place(listener), "good odometry")
    assert "rocker_right" not in listener.latest().joints
    state = read_state(LSR1, listener.latest())
    assert state is not None and np.isnan(state.tip_over_ratio)
    for values in (state.wheel_loads, state.friction_use, state.torque_use):
        assert np.isnan(values).all()
    assert listener.latest().forces_from == ""
    with pytest.raises(PlanningError, match="can_traverse"):
        listener.request_plan(np.zeros(2))


def test_what_was_learned_of_the_ground_is_told_with_the_places_where_it_was(listener, talker):
    def told() -> list[str]:
        return describe_learned(listener.latest().learned)

    def is_at(x: float) -> bool:
        return has_place(listener) and listener.latest().position[0] == x

    friction = {"mean": 0.8, "std": 0.1, "low": 0.35, "high": None}
    for x, high, words in (
        (0.0, None, "friction at least 0.35: no wheel has slipped yet"),
        (0.5, 0.9, "friction 0.80, give or take 0.10: wheels have slipped"),
    ):
        publish_until(talker.odometry, odometry(x, 0.0), lambda x=x: is_at(x), "the place")
        talker.estimates.publish(String(data=json.dumps({"friction": {**friction, "high": high}})))
        wait_until(lambda words=words: words in told(), words)
    np.testing.assert_allclose(listener.latest().trail, [[0.0, 0.0, 0.35], [0.5, 0.0, 0.8]])
    assert describe_learned(None) == []


def test_a_trail_keeps_places_a_step_apart_and_the_newest_of_many():
    ground, trail = LearnedGround(0.5, 0.1, 0.4, True), np.empty((0, 3))
    for x in np.arange(0.0, 150.0, 0.04):
        trail = add_to_trail(trail, np.array([x, 0.0]), ground)
    assert len(trail) <= MAX_TRAIL + 1 and trail[-1, 0] == pytest.approx(149.96)
    assert np.diff(trail[:-1, 0]).min() > 0.5 * TRAIL_STEP


def test_a_closed_link_leaves_no_thread_and_no_context():
    before = set(threading.enumerate())
    with listen() as listener:
        assert listener.context.ok()
        assert set(threading.enumerate()) - before
    assert not listener.context.ok()
    wait_until(lambda: set(threading.enumerate()) <= before, "the threads to end")


def test_a_stream_gets_stale_and_a_result_never():
    now = time.monotonic()
    old = now - MAX_AGE - 22.0
    odometry, plan = TopicAge(old, True), TopicAge(old, False)
    none, fresh = TopicAge(None, True), TopicAge(now, True)
    assert [one.is_stale for one in (odometry, plan, none, fresh)] == [True, False, False, False]
    assert odometry.describe() == plan.describe() == f"{MAX_AGE + 22.0:.0f} s"
    assert none.describe() == "nothing yet"


# The answer that is shown: whose question it is, and how old.

NOW = 1000.0
ALIVE = TopicAge(time.monotonic() + 1e6, True)


def question(name: str, passes: bool | None, age: float, plan=None) -> LiveQuestion:
    reason = "a wheel slips" if passes is False else ""
    return LiveQuestion(name, "0", NOW - age, passes, reason, plan)


def data_of(newest, plan, click=None, server=ALIVE) -> LiveData:
    return LiveData(newest=newest, plan=plan, click=click, ages={SIGN_OF_LIFE: server})


def test_an_answer_to_a_click_belongs_to_the_click_and_the_newest_is_one_click_away():
    click, mission = question(CLICK, False, 5.0), question("question 2", True, 3.0)
    clicked, planned = np.zeros((2, 3)), np.ones((3, 3))
    told, plan = choose_answer(data_of(mission, planned, click), NOW)
    assert told["passes"] is False and told["headline"] == "a wheel slips"
    assert told["about"] == "your click, 5 s ago" and plan is None
    [offer] = told["offers"]
    assert offer["words"] == "question 2: traversable, 3 s ago"
    assert offer["ask"] == {"ask": "newest"}
    told, plan = choose_answer(data_of(mission, planned), NOW)
    assert told["passes"] and told["about"] == "question 2, 3 s ago"
    assert plan is planned and not told["old"]
    told, plan = choose_answer(data_of(mission, planned, question(CLICK, True, 3.0, clicked)), NOW)
    assert plan is clicked and told["offers"] == []  # the newest is its own


def test_a_click_without_an_answer_says_so_in_2_s_and_shows_no_older_verdict():
    for waited, words in (
        (0.5, "asking the server"),
        (PATIENCE + 1.0, "no answer from the server"),
    ):
        click, newest = question(CLICK, None, waited), question("question 2", True, 9.0)
        told = choose_answer(data_of(newest, None, click), NOW)[0]
        assert told["passes"] is None and told["headline"].startswith(words)


def test_a_verdict_of_a_server_that_fell_silent_is_old_in_words_and_in_the_scene():
    silent = TopicAge(time.monotonic() - 20.0, True)
    data = data_of(question("question 1", True, 25.0), np.zeros((2, 3)), None, silent)
    told, _ = choose_answer(data, NOW)
    assert told["old"] == "the server is silent for 20 s"
    assert told["about"] == "question 1, 25 s ago"
    click, newest = question(CLICK, True, 25.0), question("question 2", True, 24.0)
    told, _ = choose_answer(data_of(newest, None, click, silent), NOW)
    assert told["offers"][0]["words"] == "question 2: traversable, 24 s ago, old"
