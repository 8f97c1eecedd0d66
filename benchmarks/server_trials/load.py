"""Many questions at once, and questions without a pause for minutes."""

import itertools
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from benchmarks.server_trials.stage import (
    Client,
    LostAnswerError,
    MapSource,
    Stage,
    run_together,
    straight_path,
)
from msg_adapters.identity import path_hash
from rover_physics.names import SUSPENSION_JOINTS
from rover_planner.demo.child_process import ChildProcess
from rover_planner.ros.qos import topic_qos
from support.grounds import make_terrain, waves

ASKERS = 5
"""Clients that share the questions of a burst."""
START, GOAL = (-2.0, 0.0, 0.0), (2.0, 0.3, 0.0)


@dataclass(frozen=True)
class Burst:
    """What became of questions that were asked at once."""

    times: tuple[float, ...]
    """Time of each answer, after all questions were asked [s]."""
    codes: Counter[str]
    """Answers by code, "traversable" for a yes."""


def ask_at_once(clients: list[Client], count: int, timeout: float) -> Burst:
    """Ask for a check of the last path `count` times at once; wait for all answers.

    Raises:
        LostAnswerError: There is no answer to a question within the timeout [s].
    """
    times: list[float] = []
    began = time.perf_counter()
    futures = [
        client.begin_check() for client in itertools.islice(itertools.cycle(clients), count)
    ]
    for future in futures:
        future.add_done_callback(lambda _: times.append(time.perf_counter() - began))
    while len(times) < count:
        time.sleep(0.005)
        if time.perf_counter() - began > timeout:
            raise LostAnswerError(f"{count - len(times)} of {count} answers are missing")
    codes = Counter(_code(future.result().message) for future in futures)
    return Burst(tuple(sorted(times)), codes)


def _code(message: str) -> str:
    return json.loads(message)["code"] or "traversable"


def burst(stage: Stage, count: int, budget: float, half_length: float, spacing: float) -> Burst:
    """Start a server and ask `count` questions at once about a straight path.

    Args:
        stage: Where the server runs.
        count: Number of questions.
        budget: Parameter time_budget [s].
        half_length: Half the length of the path [m].
        spacing: Parameter waypoint_spacing [m]; small ones make the questions long.
    """
    ground = make_terrain(waves, half=half_length + 2.0)
    stage.start_ready(ground, time_budget=budget, waypoint_spacing=spacing)
    clients = [stage.client(f"asker{k}") for k in range(ASKERS)]
    path = straight_path((-half_length, 0.0, 0.0), (half_length, 0.0, 0.0))
    clients[0].publish(path)
    while clients[0].check()["path_hash"] != path_hash(path):
        time.sleep(0.05)  # the path travels on another topic
    return ask_at_once(clients, count, budget + 30.0)


@dataclass
class Soak:
    """What happened in minutes of questions without a pause."""

    times: list[float] = field(default_factory=list)
    """Response times [s]."""
    lost: int = 0
    """Questions without an answer."""
    refused: int = 0
    """Questions that were refused although the ground is passable."""
    memory: list[float] = field(default_factory=list)
    """Memory of the server, once a second [MB]."""

    def growth(self, settled: int) -> float:
        """Return the growth of the memory after `settled` seconds, as a share.

        The two values are medians of ten seconds.
        """
        early, late = self.memory[settled : settled + 10], self.memory[-10:]
        return float(np.median(late) / np.median(early) - 1.0)


def soak(stage: Stage, seconds: float, clients: int) -> Soak:
    """Ask without a pause, with maps at 1 Hz and joint states at 100 Hz."""
    server = stage.start_ready(make_terrain(waves), candidate_count=1, time_budget=30.0)
    askers = [stage.client(f"asker{k}") for k in range(clients)]
    maps, result = MapSource(stage.ros), Soak()
    end = time.monotonic() + seconds
    run_together(
        *(lambda asker=asker: _ask_until(end, asker, result) for asker in askers),
        lambda: _repeat(end, 1.0, _send_maps(maps)),
        lambda: _repeat(end, 0.01, _send_joints(maps.node)),
        lambda: _repeat(end, 1.0, lambda: result.memory.append(memory_of(server))),
    )
    return result


def _ask_until(end: float, asker: Client, result: Soak) -> None:
    while time.monotonic() < end:
        began = time.perf_counter()
        try:
            plan = asker.plan(START, GOAL, 40.0)
        except LostAnswerError:
            result.lost += 1
            continue
        result.times.append(time.perf_counter() - began)
        result.refused += not plan.poses


def _repeat(end: float, period: float, work: Callable[[], object]) -> None:
    """Call a function at a fixed rate until an end on the steady clock [s]."""
    due = time.monotonic()
    while due < end:
        time.sleep(max(0.0, due - time.monotonic()))
        work()
        due += period


def _send_maps(maps: MapSource) -> Callable[[], None]:
    """Return a function that publishes a map whose content differs from the one before."""
    ground = make_terrain(waves)
    count = itertools.count()

    def send() -> None:
        elevation = ground.elevation.copy()
        elevation[0, 0] += 1e-3 * next(count)
        maps.publish(replace(ground, elevation=elevation))

    return send


def _send_joints(node: Node) -> Callable[[], None]:
    publisher = node.create_publisher(JointState, "joint_states", topic_qos())
    state = JointState(name=list(SUSPENSION_JOINTS), position=[0.0] * len(SUSPENSION_JOINTS))
    return lambda: publisher.publish(state)


def memory_of(server: ChildProcess) -> float:
    """Return the memory that a process holds now [MB]."""
    status = Path(f"/proc/{server.pid}/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024
