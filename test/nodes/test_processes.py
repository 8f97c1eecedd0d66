# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: they start, answer, end cleanly when told to, and take precedence."""

import os
import signal
import subprocess
import sys
import time

import pytest

from rover_planner.ros.process import PROFILES, TRANSPORTS, take_priority
from support.project.without_disk import fill_disk


def read_until(process, text):
    """Return the output up to a line with a text in it."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if text in line:
            return "".join(lines)
    raise AssertionError(f"ended without {text!r}: {''.join(lines)}")


def end(process, how, count=1):
    """Send a signal; return what the process says until it ends, which must be cleanly."""
    for _ in range(count):
        process.send_signal(how)
        time.sleep(0.01)
    rest, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0 and "Traceback" not in rest, rest
    return rest


PUBLISHING = ["start_x:=-46.0", "start_y:=-19.5", "rate:=500.0", "map_rate:=20.0"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "parameters", "ready", "how"),
    [
        ("traverse_server", [], "lsr1, map spirit", signal.SIGINT),
        ("rover_simulator", PUBLISHING, "ready", signal.SIGTERM),
    ],
)
def test_a_node_that_is_told_so_ends_cleanly(start_process, name, parameters, ready, how):
    process = start_process(name, "terrain_file:=spirit", *parameters)
    read_until(process, ready)
    time.sleep(0.3)
    end(process, how, count=3)  # launch and the terminal both send one


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "how"), [("traverse_server", signal.SIGTERM), ("traction_controller", signal.SIGINT)]
)
def test_a_signal_ends_a_node_while_kernels_compile(
    start_process, tmp_path, monkeypatch, name, how
):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    process = start_process(name)
    read_until(process, "compiling kernels 1 of ")
    time.sleep(0.5)
    assert "ready" not in end(process, how)


def test_what_no_system_grants_is_told_and_zero_and_a_thread_that_has_ended_are_no_refusal(
    tmp_path, monkeypatch
):
    assert take_priority(0) == ""
    assert "realtime_priority 1000" in take_priority(1000)
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    (tmp_path / str(process.pid)).touch()
    monkeypatch.setattr("rover_planner.ros.process.THREADS", tmp_path)
    assert take_priority(3) == ""
    assert take_priority(3, [os.getpid()]) == ""


@pytest.mark.long
def test_a_server_starts_on_a_full_disk_without_a_log_file_and_says_so(start_process):
    process = start_process("traverse_server", preexec_fn=fill_disk)
    read_until(process, "no log file is written: File too large")


PROGRAM = """
import os, pathlib, rclpy, threading
from rover_planner.ros.process import PRECEDENCE, init_ros, take_priority
init_ros([])
node = rclpy.create_node("alone")
print(*(file.read_text().strip() for file in pathlib.Path("/proc/self/task").glob("*/comm")))
one = threading.Thread(target=threading.Event().wait, daemon=True)
one.start()

def urgent_threads():
    ids = [int(name) for name in os.listdir("/proc/self/task")]
    return len(ids), [id for id in ids if os.sched_getscheduler(id) == os.SCHED_FIFO]

print(take_priority(3, [one.native_id]))
main = threading.get_native_id()
goes_first = os.getpriority(os.PRIO_PROCESS, main) == PRECEDENCE
print(urgent_threads()[1] == [one.native_id] and goes_first)
print(take_priority(3))
count, urgent = urgent_threads()
print(len(urgent) == count)
print([line for line in open("/proc/self/status") if line.startswith("THP_enabled")])
"""


def test_a_program_waits_for_no_shared_memory_no_huge_pages_and_no_processor():
    environment = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    for name in (TRANSPORTS, PROFILES):
        environment.pop(name, None)
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    threads, *told, pages = ran.stdout.splitlines()
    assert "dds.udp" in threads and "dds.shm" not in threads
    for reason, taken in zip(told[::2], told[1::2], strict=True):
        assert taken == "True" if reason == "" else "CAP_SYS_NICE" in reason
    assert "THP_enabled:\\t0" in pages
