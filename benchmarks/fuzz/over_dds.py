"""Throws hostile messages, requests and damaged bytes over DDS at running nodes."""

import contextlib
import os
import re
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rclpy
from nav_msgs.srv import GetPlan
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from benchmarks.fuzz.hostile import HostileMaker
from benchmarks.fuzz.inside import GOAL, START, good_ground
from benchmarks.fuzz.nodes import (
    CONTROLLER,
    SERVER,
    TOPICS,
    FuzzClient,
    NodeProcesses,
    serialise,
)
from benchmarks.fuzz.tally import DAMAGED, WHOLE, Tally, memory_of
from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import stamped_pose
from rover_planner.demo.child_process import stopping_children

BATCH = 50
"""Inputs between two probes."""
PROBE_TIME = 2.0
"""Longest wait for the answer to a probe after the batch's questions [s]."""
ANSWER_TIME = 8.0
"""Longest wait for the answer to a hostile request [s]."""
PAUSE = 0.002
"""Time between two inputs [s]."""
DAMAGED_SHARE = 0.25
"""Share of messages whose bytes are damaged."""
MAX_GROWTH = 600.0
"""Largest growth of a node's memory in use [MB]."""
MAX_TORQUE = 2.0
"""Largest torque of a wheel of LSR-1 [N m]."""
_STAMP = re.compile(r"^\[(\w+)\] \[[\d.]+\]")
KINDS = (*TOPICS, "plan", "load_map", "parameters", "check_path", "check_reach")


class DdsFuzzer:
    """Throws batches of inputs at the nodes and probes them after each."""

    def __init__(self, seed: int, client: FuzzClient, nodes: NodeProcesses):
        self._maker, self.tally = HostileMaker(seed), Tally()
        self._client, self._nodes = client, nodes
        self._cloud = terrain_to_point_cloud(good_ground(), "map")
        client.wait_for_nodes()
        client.feed_controller(0.5)
        self._plan = self._ask()
        self._first = self._memory()

    def run(self, count: int) -> None:
        """Throw a number of inputs."""
        for first in range(0, count, BATCH):
            kinds = [self._throw() for _ in range(min(BATCH, count - first))]
            self._probe(f"inputs {first} to {first + len(kinds) - 1}")
        growth = {name: self._memory()[name] - mb for name, mb in self._first.items()}
        words = ", ".join(f"{name} by {mb:.0f} MB" for name, mb in growth.items())
        self.tally.notes.append(f"memory grew: {words}")
        for name, mb in growth.items():
            if mb > MAX_GROWTH:
                self.tally.defects.append(f"{name} grew by more than {MAX_GROWTH:.0f} MB")
        worst = self._client.worst_torque
        self.tally.notes.append(
            f"largest torque: {worst:.2f} N m, {self._client.commands} commands"
        )
        if not worst <= MAX_TORQUE:
            self.tally.defects.append(f"a torque of {worst} N m was commanded")

    def _throw(self) -> str:
        """Throw one input and return its kind."""
        rng = self._maker.rng
        kind = KINDS[rng.integers(len(KINDS))]
        began, outcome = time.perf_counter(), WHOLE
        if kind in TOPICS:
            message = self._maker.make(kind)
            if rng.random() < DAMAGED_SHARE:
                message, outcome = self._maker.damaged(serialise(message)), DAMAGED
            self._client.publish(kind, message)
        else:
            response = self._client.call(kind, self._request(kind), ANSWER_TIME)
            if response is None:
                self.tally.defects.append(f"{kind}: no answer within {ANSWER_TIME:.0f} s")
        self.tally.take(kind, outcome, time.perf_counter() - began)
        time.sleep(PAUSE)
        return kind

    def _request(self, kind: str) -> Any:
        if kind == "plan":
            return self._maker.plan_request()
        if kind == "load_map":
            return self._maker.map_request()
        return self._maker.parameter_request() if kind == "parameters" else Trigger.Request()

    def _probe(self, where: str) -> None:
        """Check that both nodes live, answer and keep a good map."""
        for name, process in self._nodes.running.items():
            if not process.running:
                self.tally.defects.append(f"{where}: {name} died: {process.last_words()[:200]}")
                self._nodes.restart(name)
                self._client.wait_for_nodes()
        if not self._client.reset_parameters(ANSWER_TIME):
            self.tally.defects.append(f"{where}: parameters were not set back")
        self._client.publish("cloud", self._cloud)
        began = time.perf_counter()
        wrong = self._wait_for_answer()
        if wrong:
            self.tally.defects.append(f"{where}: {SERVER}: {wrong}")
        self.tally.take("probe", WHOLE, time.perf_counter() - began)
        if not self._client.feed_controller(0.3):
            self.tally.defects.append(f"{where}: {CONTROLLER} sends no commands")

    def _wait_for_answer(self) -> str:
        """Return what is wrong with the answer to a known question within PROBE_TIME."""
        end, wrong = time.monotonic() + PROBE_TIME, "no answer"
        while time.monotonic() < end:
            plan = self._ask(end - time.monotonic())
            if plan == self._plan:
                return ""
            wrong = wrong if plan is None else "another answer to the same question"
            time.sleep(0.05)
        return wrong

    def _ask(self, timeout: float = ANSWER_TIME) -> list[tuple[float, float]] | None:
        """Return the places of the plan for a known question; None without an answer."""
        request = GetPlan.Request(start=stamped_pose(START, "map"), goal=stamped_pose(GOAL, "map"))
        response = self._client.call("plan", request, timeout)
        if response is None:
            return None
        return [
            (stamped.pose.position.x, stamped.pose.position.y) for stamped in response.plan.poses
        ]

    def _memory(self) -> dict[str, float]:
        return {name: memory_of(process.pid) for name, process in self._nodes.running.items()}


def fuzz_over_dds(seed: int, count: int) -> Tally:
    """Throw hostile inputs at nodes in processes of their own and return what became of them."""
    domain = 101 + os.getpid() % 100
    with (
        tempfile.TemporaryDirectory() as folder,
        stopping_children() as children,
        _spinning(domain) as node,
    ):
        nodes = NodeProcesses(Path(folder), children, domain, good_ground())
        fuzzer = DdsFuzzer(seed, FuzzClient(node), nodes)
        fuzzer.run(count)
        for name in (SERVER, CONTROLLER):
            lines = [_STAMP.sub("", line) for line in nodes.log(name).splitlines()]
            told = Counter(line for line in lines if "internal error" in line)
            fuzzer.tally.notes += [
                f"{name}: {count} x {text[:160]}" for text, count in told.items()
            ]
            fuzzer.tally.defects += [f"{name}: {text}" for text in lines if "Warning:" in text]
        return fuzzer.tally


@contextlib.contextmanager
def _spinning(domain: int) -> Iterator[Node]:
    """Yield a node that spins in a thread."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("fuzzer", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield node
    finally:
        rclpy.shutdown(context=context)
        thread.join(5.0)
