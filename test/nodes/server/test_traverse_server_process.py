"""The traverse server as a process of its own: it starts, answers and ends cleanly."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.srv import GetPlan
from rclpy.node import Node

from msg_adapters.paths import stamped_pose
from rover_physics.terrain.grid import Terrain, save_terrain
from support.grounds import make_terrain, waves
from support.planner_client import PlannerClient
from support.ros_fixtures import RosRun, domain_id
from support.waiting import wait_until


@pytest.fixture
def start_process():
    processes = []

    def start(*parameters):
        arguments = [word for text in parameters for word in ("-p", text)]
        module = "rover_planner.nodes.traverse_server"
        process = subprocess.Popen(
            [sys.executable, "-m", module, "--ros-args", *arguments],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain_id()), "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.wait()


def read_until(process, text):
    """Return the output up to a line with a text in it."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if text in line:
            return lines
    raise AssertionError(f"ended without {text!r}: {''.join(lines)}")


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_it_says_what_it_does_and_ends_cleanly(start_process, how):
    process = start_process()
    lines = read_until(process, "ready for rover lsr1")
    assert "compiling kernels" in "".join(lines)
    for _ in range(3):  # launch and the terminal both send one
        process.send_signal(how)
        time.sleep(0.01)
    rest, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0 and "Traceback" not in rest


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_while_kernels_compile(start_process, tmp_path, monkeypatch, how):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    process = start_process()
    read_until(process, "compiling kernels 1 of 3: rover")
    time.sleep(1.0)
    process.send_signal(how)
    rest, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0 and "Traceback" not in rest and "ready" not in rest


def test_another_process_gets_an_answer(start_process, tmp_path):
    save_terrain(tmp_path / "flat.npz", Terrain(np.zeros((101, 101)), 0.05, (-2.5, -2.5)))
    run = RosRun()
    try:
        client = run.spin(PlannerClient(run))
        file = tmp_path / "flat.npz"
        process = start_process(f"terrain_file:={file}", "time_budget:=60.0")
        read_until(process, "ready for rover lsr1")
        plan, results = client.next_results(
            lambda: client.can_traverse((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        )
        assert len(plan.poses) == 21 and len(results["plan"].poses) == 21
    finally:
        run.close()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_the_middle_of_a_question_which_is_refused(
    start_process, tmp_path, how
):
    save_terrain(tmp_path / "waves.npz", make_terrain(waves))
    run = RosRun()
    try:
        asker, open_counts = run.spin(Node("asker", context=run.context)), []

        def note(message):
            values = {entry.key: entry.value for entry in message.status[0].values}
            open_counts.append(values["open questions"])

        asker.create_subscription(DiagnosticArray, "diagnostics", note, 10)
        process = start_process(
            f"terrain_file:={tmp_path / 'waves.npz'}",
            "time_budget:=600.0",
            "waypoint_spacing:=0.001",
            "candidate_count:=99",
            "candidate_spacing:=0.01",
        )
        read_until(process, "ready for rover lsr1")
        service = asker.create_client(GetPlan, "/traverse_server/can_traverse")
        assert service.wait_for_service(20.0)
        start, goal = (stamped_pose((x, 0.0, 0.0), "map") for x in (-3.0, 3.0))
        future = service.call_async(GetPlan.Request(start=start, goal=goal))
        wait_until(lambda: open_counts and open_counts[-1] == "1", "the question in work")
        assert not future.done()
        process.send_signal(how)
        rest, _ = process.communicate(timeout=60.0)
        assert process.returncode == 0 and "Traceback" not in rest
        wait_until(future.done, "the refusal")
        assert future.result().plan.poses == []
    finally:
        run.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        ("friction:=.nan", "friction"),
        ("rover:=lsr9", "lsr9"),
        ("policy:=fair", "fair"),
        ("candidate_count:=9.5", "candidate_count"),
        ("terrain_file:=/no/such/file.npz", "/no/such/file.npz"),
    ],
)
def test_a_wrong_parameter_ends_it_with_one_line(start_process, parameter, text):
    process = start_process(parameter)
    output, _ = process.communicate(timeout=180.0)
    assert process.returncode == 2 and "Traceback" not in output
    assert text in output.strip().splitlines()[-1]
