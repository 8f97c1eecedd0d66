# SPDX-License-Identifier: Apache-2.0
"""The mission planner reads its goals, and tells by its exit code what came of them."""

import json
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node

from msg_adapters.paths import poses_path
from rover_planner.advice import seek
from rover_planner.advice.levers import LEVERS
from rover_planner.errors import DriveFailedError, NoAnswerError
from rover_planner.nodes import mission_planner
from rover_planner.nodes.mission_planner import main
from rover_planner.nodes.start import MissionOptions, read_arguments
from rover_planner.planning.answering.budget import STOPPING
from rover_planner.shell.poses import Pose
from support.grounds import make_terrain, rock_left, wall_at, waves
from support.messages import odometry_at
from support.ros_fixtures import domain_id, run_in_executor
from support.waiting import wait_until

START, NEAR, BEYOND = "--start=-2,0,0", "--goal=-0.5,0,0", "--goal=2,0,0"
"""Words for a start, a goal before the wall at x = 0.5 m, and one behind it."""


def test_negative_numbers_need_no_equals_sign_and_words_of_ros_are_put_aside():
    words = ["--start", "-3", "0", "0", "--goal=-.5", "-1e-1", "0"]
    ros_words = ["--ros-args", "-r", "__node:=planner", "-p", "use_sim_time:=true"]
    options = read_arguments("mission_planner", [*words, *ros_words, "--", BEYOND, "--json"])
    assert isinstance(options, MissionOptions)
    assert options.start == Pose(-3.0, 0.0, 0.0)
    assert options.goal == [Pose(-0.5, -0.1, 0.0), Pose(2.0, 0.0, 0.0)]
    assert options.as_json and not options.drive


@pytest.fixture
def run_planner(monkeypatch, capfd):
    """Return a function that runs the program; it returns exit code, stdout and stderr."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id()))

    def run(*words):
        code = main([START, *words])
        return (code, *capfd.readouterr())

    return run


def test_answers_drives_and_refusals_have_exit_codes_of_their_own(start_server, run_planner):
    server = start_server(planner="fan")
    code, out, _ = run_planner(NEAR, "--timeout=4")  # nothing is judged without a map
    assert code == 1 and "goal 1: not judged, " in out
    server.service.take_terrain(make_terrain(wall_at(0.5)))
    code, out, _ = run_planner(BEYOND, NEAR)
    told = [line for line in out.splitlines() if line.startswith("goal ")]
    assert code == 3 and len(told) == 2
    assert told[0].startswith("goal 1: no, ") and told[1] == "goal 2: yes"
    code, out, _ = run_planner("--goal=90,0,0", "--timeout=20")  # most of it is not predicted
    assert code == 3 and "goal 1: no, " in out
    code, out, _ = run_planner(NEAR, NEAR, "--json")
    assert code == 0
    events = [json.loads(line) for line in out.splitlines()]
    answers = [event for event in events if event["event"] == "answer"]
    assert [event["goal"] for event in answers] == [1, 2]
    for event in answers:
        assert f"chose {event['answer']['chosen_candidate']}:" in event["answer"]["explanation"]
    code, out, err = run_planner(NEAR, "--drive", "--timeout=4")  # there is no rover
    assert code == 1 and "goal 1: yes" in out
    assert "mission_planner: waited 4 s in vain for a rover on the topic path\n" in err


def test_after_a_drive_the_next_goal_is_asked_for_from_where_the_rover_is(
    start_server, run_planner, monkeypatch
):
    end = [-0.6, 0.05, 0.1]
    arrived = SimpleNamespace(run=lambda _plan: np.array(end))
    monkeypatch.setattr(mission_planner, "Drive", lambda *_: arrived)
    server = start_server(planner="fan")
    server.service.take_terrain(make_terrain(waves))
    code, out, _ = run_planner(NEAR, "--goal=1,0,0", "--drive", "--json")
    events = [json.loads(line) for line in out.splitlines()]
    first, second = (event["answer"]["poses"] for event in events if event["event"] == "answer")
    assert code == 0 and first[0] == pytest.approx([-2.0, 0.0, 0.0])
    assert second[0] == pytest.approx(end)


@pytest.mark.parametrize(
    ("ground", "parameters", "lever", "words", "policy"),
    [
        (rock_left, {}, "shift", " m ", "equal"),
        (lambda x, y: 0.3 * x, {"friction": 0.45}, "policy", "by speed servos", "servo"),
    ],
)
def test_advice_that_needs_nobody_else_is_taken(
    start_server, run_planner, monkeypatch, ground, parameters, lever, words, policy
):
    monkeypatch.setattr(seek, "LEVERS", [one for one in LEVERS if one.name == lever])
    patient = {"planner": "fan", "candidate_count": 1, "advice_time": 60.0, "time_budget": 60.0}
    server = start_server(**patient, **parameters)
    server.service.take_terrain(make_terrain(ground, half=3.0))
    code, out, _ = run_planner("--goal=1.2,0,0", "--advise")
    lines = [line for line in out.splitlines() if line.startswith(("goal", "advice"))]
    assert code == 0 and lines[0].startswith("goal 1: no, ")
    assert lines[1].startswith("advice: ") and words in lines[1]
    assert lines[2] == "goal 1: yes"
    assert server.get_parameter("policy").value == policy


def test_where_advice_needs_others_the_refusal_stays(start_server, run_planner, monkeypatch):
    monkeypatch.setattr(seek, "LEVERS", [one for one in LEVERS if one.needs_others])
    server = start_server(planner="fan", candidate_count=1, advice_time=60.0)
    server.service.take_terrain(make_terrain(wall_at(0.5)))
    code, out, _ = run_planner(BEYOND, "--advise")
    assert code == 3 and "advice: none that a mission planner can take; " in out


def test_without_a_server_it_gives_up_in_time_and_says_what_it_waited_for(run_planner):
    code, _, err = run_planner(NEAR, "--timeout=1")
    assert code == 4 and err.count("\n") == 1
    assert "in vain for the service /traverse_server/can_traverse and the topic /tra" in err


def test_a_path_that_is_refused_before_it_is_judged_was_not_judged(server, planner):
    planner.wait_for_server()
    answer = planner.check(np.array([(-2.0, 0.0, 0.0), (0.0, 0.0, 0.0)]))
    assert (answer.code, answer.was_judged) == ("no_map", False)


def test_a_wrong_parameter_of_ros_is_bad_input_and_a_signal_between_two_looks_an_interruption(
    run_planner, monkeypatch
):
    code, _, err = run_planner(NEAR, "--ros-args", "-p", "use_sim_time:=5")
    assert code == 2 and err.count("\n") == 1 and "use_sim_time" in err

    def check(planner):
        rclpy.shutdown()  # as the handler of a signal does
        planner.check(np.zeros((2, 3)))

    monkeypatch.setattr(mission_planner.MissionPlanner, "wait_for_server", check)
    code, _, err = run_planner(NEAR)
    assert (code, err) == (130, "")


def test_a_question_that_a_server_does_not_answer_because_it_ends_is_asked_again(
    server, endless, planner
):
    answers = []
    server.service.take_terrain(make_terrain(waves))
    planner.wait_for_server()
    with endless():
        start, goal = (-2.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        ask = threading.Thread(target=lambda: answers.append(planner.ask(start, goal)))
        ask.start()
        wait_until(lambda: server.desk.open_count == 1, "the question")
        run_in_executor(server, lambda: server.desk.cancel(STOPPING, "it is shutting down"))
    ask.join(20.0)
    assert answers[0].traversable


def test_a_second_planner_waits_for_the_end_of_the_first_and_a_path_from_elsewhere_ends_a_drive(
    ros, make_planner
):
    rover = ros.spin(Node("follower", context=ros.context))
    odometry = rover.create_publisher(Odometry, "odometry", 10)
    rover.create_subscription(Path, "path", lambda path: None, 10)
    first, second = (
        make_planner(timeout=2.0, cli_args=["--ros-args", "-r", f"__node:={name}"])
        for name in ("first", "second")
    )
    first.send_path(np.zeros((1, 3)))
    with pytest.raises(NoAnswerError, match="the end of first, which sends the rover paths"):
        second.send_path(np.zeros((1, 3)))
    path = rover.create_publisher(Path, "path", 10)
    with pytest.raises(DriveFailedError, match="another node has sent the rover a path"):
        for _ in range(100):
            odometry.publish(odometry_at((0.0, 0.0, 0.0)))
            path.publish(poses_path(np.ones((2, 3)), "map"))
            first.wait_for_pose(lambda pose: True, 0.1)
