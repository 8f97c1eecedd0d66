# SPDX-License-Identifier: Apache-2.0
"""Loads a traverse server: many questions at once, minutes of them, requests meanwhile, its death.

Servers run in processes of their own and are asked over DDS.
"""

import itertools
import json
import os
import signal
import statistics
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState, PointCloud2

from benchmarks.measure import Figure, quantile
from benchmarks.processes import (
    SERVER,
    START_TIME,
    Client,
    LostAnswerError,
    NodeProcesses,
    finish,
    memory_of,
    open_nodes,
    repeat,
)
from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.identity import path_hash
from msg_adapters.paths import poses_path
from rover_physics import Terrain
from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.demo.child_process import ChildProcess
from rover_planner.ros.qos import map_qos, topic_qos
from support.grounds import make_terrain, rocky, waves
from support.waiting import wait_until

QUESTIONS, ASKERS = 50, 5
"""Questions of a burst, and clients that share them."""
BUDGET = 5.0
"""Parameter time_budget in a burst [s]."""
BURSTS = {"light": (1.5, 0.05), "1 s each": (30.0, 0.003), "beyond the budget": (45.0, 0.001)}
"""Half the length of the path of a burst, and distance of its waypoints [m]."""
SECONDS = 60.0
"""Time of questions without a pause [s]."""
REPEATS = 5
"""Repeats of requests and of deaths during a question."""
HEAVY = {"waypoint_spacing": 0.001, "candidate_count": 99, "candidate_spacing": 0.01}
"""Parameters with which a question of some metres takes minutes."""
START, GOAL = (-3.0, 0.0, 0.0), (3.0, 0.5, 0.0)
ANSWER_TIME, PAUSE = 0.2, 0.05
"""Time after which a client asks again without an answer, and after a refusal [s]."""


def measure() -> list[Figure]:
    """Measure bursts, a soak, requests during a question, a signal and a restart."""
    figures = []
    for name, (half_length, spacing) in BURSTS.items():
        with open_nodes() as nodes:
            found = burst(nodes, QUESTIONS, BUDGET, half_length, spacing)
        figures += [
            Figure("burst", f"{name}: {code}", count, "", repeats=1)
            for code, count in sorted(found.codes.items())
        ]
        name = f"{name}: last answer"
        figures.append(Figure("burst", name, max(found.times), "s", BUDGET + 0.2, repeats=1))
    with open_nodes() as nodes:
        figures += make_soak_figures(soak(nodes, SECONDS, clients=2))
    with open_nodes() as nodes:
        figures += time_hearing(nodes, REPEATS)
    ends, restarts = [], []
    for _ in range(REPEATS):
        with open_nodes() as nodes:
            ends.append(time_signal(nodes))
        with open_nodes() as nodes:
            restarts.append(time_restart(nodes))
    for name, times, most in (
        ("SIGINT during a question: until exit", ends, None),
        ("SIGKILL, start: first answer", [answer for answer, _ in restarts], 3.0),
        ("SIGKILL, start: first plan, on the latched map", [plan for _, plan in restarts], 3.0),
    ):
        figures += _spread("restart", name, times, "s", most)
    return figures


def _spread(
    topic: str, name: str, times: list[float], unit: str, most: float | None
) -> list[Figure]:
    """Return median and largest of times."""
    count = len(times)
    return [
        Figure(topic, f"{name}, p50", statistics.median(times), unit, most, repeats=count),
        Figure(topic, f"{name}, longest", max(times), unit, most, repeats=count),
    ]


def start_server(
    nodes: NodeProcesses, terrain: Terrain | None = None, **parameters: Any
) -> ChildProcess:
    """Start a server that tries candidates only; wait until it is ready."""
    if terrain is not None:
        parameters["terrain_file"] = terrain
    server = nodes.start(SERVER, planner="fan", **parameters)
    wait_for_log(server, "ready for rover")
    return server


def wait_for_log(server: ChildProcess, text: str) -> None:
    """Wait until a line of a server's log has a text in it; fail if the server ends before."""

    def heard() -> bool:
        log = server.log.read_text(errors="replace")
        assert text in log or server.running, f"the server has ended: {log}"
        return text in log

    wait_until(heard, f"the log line {text!r}", START_TIME)


class MapSource:
    """A node that publishes maps transient-local, and hears the server's log."""

    def __init__(self, nodes: NodeProcesses):
        context = nodes.ros.context
        self.node = nodes.ros.spin(Node("map_source", context=context))
        self.logs: list[str] = []
        self._cloud = self.node.create_publisher(PointCloud2, "elevation_cloud", map_qos())
        # Lines of before the server knows the subscription are heard, too.
        lines = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(Log, "/rosout", lambda m: self.logs.append(m.msg), lines)

    def publish(self, terrain: Terrain) -> None:
        """Publish a map."""
        self._cloud.publish(terrain_to_point_cloud(terrain, "map"))

    def give(self, terrain: Terrain) -> float:
        """Publish a map; return the time [s] until the server says that it is in use."""
        wait_until(lambda: self._cloud.get_subscription_count() > 0, "the server", START_TIME)
        before, began = len(self.logs), time.perf_counter()
        self.publish(terrain)
        wait_until(lambda: any("map from" in log for log in self.logs[before:]), "the map")
        return time.perf_counter() - began


@dataclass(frozen=True)
class Burst:
    """Times and codes of the answers to questions that were asked at once."""

    times: tuple[float, ...]
    """Time of each answer, after all questions were asked [s]."""
    codes: Counter[str]
    """Answers by code, "traversable" for a yes."""


def burst(
    nodes: NodeProcesses, count: int, budget: float, half_length: float, spacing: float
) -> Burst:
    """Start a server and ask `count` questions at once about a straight path.

    Args:
        nodes: Where the server runs.
        count: Number of questions.
        budget: Parameter time_budget [s].
        half_length: Half the length of the path [m].
        spacing: Parameter waypoint_spacing [m]; small ones make the questions long.
    """
    ground = make_terrain(waves, half=half_length + 2.0)
    start_server(nodes, ground, time_budget=budget, waypoint_spacing=spacing)
    clients = [nodes.client(f"asker{k}").connect() for k in range(ASKERS)]
    path = poses_path([(-half_length, 0.0, 0.0), (half_length, 0.0, 0.0)], "map")
    clients[0].publish(path)
    while clients[0].check()["path_hash"] != path_hash(path):
        time.sleep(PAUSE)  # the path travels on another topic
    times: list[float] = []
    began = time.perf_counter()
    askers = itertools.islice(itertools.cycle(clients), count)
    futures = [asker.begin_check() for asker in askers]
    for future in futures:
        future.add_done_callback(lambda _: times.append(time.perf_counter() - began))
    messages = [finish(future, budget + 30.0).message for future in futures]
    codes = Counter(json.loads(message)["code"] or "traversable" for message in messages)
    return Burst(tuple(sorted(times)), codes)


@dataclass
class Soak:
    """Response times, lost answers and memory under questions without a pause."""

    times: list[float] = field(default_factory=list)
    """Response times [s]."""
    lost: int = 0
    """Questions without an answer."""
    refused: int = 0
    """Questions that were refused although the ground is passable."""
    memory: list[float] = field(default_factory=list)
    """Memory of the server, once a second [MB]."""


def soak(nodes: NodeProcesses, seconds: float, clients: int) -> Soak:
    """Ask without a pause, with maps of new content at 1 Hz and joint states at 100 Hz."""
    server = start_server(nodes, make_terrain(waves), candidate_count=1, time_budget=30.0)
    askers = [nodes.client(f"asker{k}").connect() for k in range(clients)]
    maps, result, count, ground = MapSource(nodes), Soak(), itertools.count(), make_terrain(waves)
    joints = maps.node.create_publisher(JointState, "joint_states", topic_qos())
    state = JointState(name=list(SUSPENSION_JOINTS), position=[0.0] * len(SUSPENSION_JOINTS))
    end = time.monotonic() + seconds

    def ask_until_end(asker: Client) -> None:
        while time.monotonic() < end:
            began = time.perf_counter()
            try:
                plan = asker.plan((-2.0, 0.0, 0.0), (2.0, 0.3, 0.0), 40.0)
            except LostAnswerError:
                result.lost += 1
                continue
            result.times.append(time.perf_counter() - began)
            result.refused += not plan.poses

    def send_map() -> None:
        elevation = ground.elevation.copy()
        elevation[0, 0] += 1e-3 * next(count)
        maps.publish(replace(ground, elevation=elevation))

    run_together(
        *(lambda asker=asker: ask_until_end(asker) for asker in askers),
        lambda: repeat(end, 1.0, send_map),
        lambda: repeat(end, 0.01, lambda: joints.publish(state)),
        lambda: repeat(end, 1.0, lambda: result.memory.append(memory_of(server))),
    )
    return result


def make_soak_figures(found: Soak) -> list[Figure]:
    """Return the figures of a soak."""
    settled, count = len(found.memory) // 4, len(found.times)
    early, late = (np.median(part[:10]) for part in (found.memory[settled:], found.memory[::-1]))
    rows = [
        ("questions a second", count / SECONDS, "1/s", None),
        ("answers lost", found.lost, "", 0.0),
        ("questions refused", found.refused, "", 0.0),
        ("memory after a quarter", float(early), "MB", None),
        ("growth after a quarter", 100.0 * float(late / early - 1.0), "%", 1.0),
    ]
    for share in (0.5, 0.99, 1.0):
        name = f"response time, quantile {share:g}"
        rows.append((name, 1e3 * quantile(found.times, share), "ms", None))
    return [Figure("soak", *row, repeats=count) for row in rows]


def start_heavy(nodes: NodeProcesses) -> tuple[ChildProcess, Client]:
    """Start a server whose questions take minutes; return it and an asker."""
    server = start_server(nodes, make_terrain(waves), time_budget=600.0, **HEAVY)
    return server, nodes.client("asker").connect()


def time_hearing(nodes: NodeProcesses, repeats: int) -> list[Figure]:
    """Time requests during questions that would take minutes."""
    _, asker = start_heavy(nodes)
    other, maps = nodes.client("other").connect(), MapSource(nodes)
    times: dict[str, list[float]] = {"set_parameters": [], "map": [], "cancelled question": []}
    for number in range(repeats):
        future = asker.begin_plan(START, GOAL)
        time.sleep(0.3)
        for k in range(5):
            began = time.perf_counter()
            assert other.set_parameter("friction", 0.6 + 0.01 * k)
            times["set_parameters"].append(time.perf_counter() - began)
            time.sleep(0.02)
        times["map"].append(maps.give(make_terrain((waves, rocky)[(number + 1) % 2])))
        assert not future.done(), "the question has ended before it was cancelled"
        began = time.perf_counter()
        assert other.cancel().success
        wait_until(future.done, "the cancelled question")
        times["cancelled question"].append(time.perf_counter() - began)
    return [
        figure
        for name, values in times.items()
        for figure in _spread("hearing", name, [1e3 * value for value in values], "ms", 100.0)
    ]


def time_signal(nodes: NodeProcesses) -> float:
    """Return the time from SIGINT, during a question, to the end of the process [s]."""
    server, asker = start_heavy(nodes)
    future = asker.begin_plan(START, GOAL)
    time.sleep(0.5)
    assert not future.done()
    began = time.perf_counter()
    os.kill(server.pid, signal.SIGINT)
    wait_until(lambda: not server.running, "the end of the server")
    assert server.exit_code == 0, server.last_line()
    return time.perf_counter() - began


def time_restart(nodes: NodeProcesses) -> tuple[float, float]:
    """Kill a server during a question and start it again; its map is latched by its publisher.

    Returns:
        Times from the start to the first answer, which may be that there is no map yet, and to the
        first plan [s].
    """
    maps = MapSource(nodes)
    first = start_server(nodes, time_budget=600.0, **HEAVY)
    asker = nodes.client("asker").connect()
    maps.give(make_terrain(waves))
    future = asker.begin_plan(START, GOAL)
    time.sleep(0.5)
    assert not future.done()
    os.kill(first.pid, signal.SIGKILL)
    wait_until(lambda: not first.running, "the end of the server")
    began = time.perf_counter()
    second = nodes.start(SERVER, planner="fan")
    answer, patience = 0.0, ANSWER_TIME
    while True:
        try:
            plan = asker.plan(START, GOAL, patience)
        except LostAnswerError:
            assert second.running, second.last_line()
            patience *= 1.2  # a busy machine needs more time for an answer
            continue
        answer = answer or time.perf_counter() - began
        if plan.poses:
            return answer, time.perf_counter() - began
        time.sleep(PAUSE)


def run_together(*functions: Callable[[], Any]) -> list[Any]:
    """Call functions in threads at once; return their results, or raise the first error."""
    with ThreadPoolExecutor(len(functions)) as pool:
        return [future.result() for future in [pool.submit(one) for one in functions]]
