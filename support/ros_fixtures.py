# SPDX-License-Identifier: Apache-2.0
"""ROS for tests: separate contexts and domains, executors that spin in the background."""

import contextlib
import os
import threading
import zlib
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from rover_planner.ros.guard import GuardedExecutor
from support.waiting import TIMEOUT, wait_until

DOMAINS = 50
"""Number of the domains of tests, 1 to 50; a demo takes one above them."""

PATIENT = {
    "joint_states_timeout": 1.0,
    "imu_timeout": 1.0,
    "cmd_vel_timeout": 10.0,
    "watchdog_timeout": 1.0,
}
"""The longest timeouts of a controller: a busy machine makes no difference, one that stalls for
longer does."""


def domain_id() -> int:
    """Return the domain of this test process, so that parallel runs are separate.

    The processes that a test starts have the domain of their test, not that of another one.
    """
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    first = os.getpid() if run is None else zlib.crc32(run.encode())
    return 1 + (first + worker) % DOMAINS


class RosRun:
    """A context with nodes; each node has its own executor and thread."""

    def __init__(self, domain: int | None = None) -> None:
        """Begin on a domain, by default that of this test process."""
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain_id() if domain is None else domain)
        self._ending = threading.Event()
        self._spinning: list[tuple[Node, SingleThreadedExecutor, threading.Thread]] = []

    def spin(self, node: Node) -> Node:
        """Spin a node of this context in the background from now on."""
        executor = GuardedExecutor(context=self.context)
        executor.add_node(node)
        thread = threading.Thread(target=self._spin, args=(executor,), daemon=True)
        thread.start()
        self._spinning.append((node, executor, thread))
        return node

    def start(self, kind: Callable[..., Node], words: Sequence[str] = (), **values: Any) -> Any:
        """Spin a new node of a kind, with words of its command line and values of parameters."""
        given = [Parameter(name, value=value) for name, value in values.items()]
        return self.spin(kind(context=self.context, cli_args=[*words], parameter_overrides=given))

    def close(self) -> None:
        """End all nodes and the context, unless a test has shut that down."""
        self._ending.set()
        for node, executor, thread in self._spinning:
            executor.create_task(lambda: None)  # what `wake` alone wakes goes on waiting
            thread.join(TIMEOUT)
            executor.shutdown()
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _spin(self, executor: SingleThreadedExecutor) -> None:
        # executor.spin() is not used: it sometimes misses executor.shutdown().
        with contextlib.suppress(ExternalShutdownException):
            while not self._ending.is_set():
                executor.spin_once(timeout_sec=TIMEOUT)


def hear(node: Node, kind: type, topic: str, qos: QoSProfile | int = 10) -> list[Any]:
    """Return a list that gets each message which a node hears on a topic from now on."""
    heard: list[Any] = []
    node.create_subscription(kind, topic, heard.append, qos)
    return heard


def run_in_executor(node: Node, function: Callable[[], Any]) -> Any:
    """Run a function in the thread that spins a node, as its callbacks are; return its result."""
    task = node.executor.create_task(function)
    wait_until(task.done, "the executor")
    return task.result()


def call(client, request, timeout: float = TIMEOUT, attempts: int = 2):
    """Call a service and return its response, which each attempt waits for [s]."""
    assert client.wait_for_service(timeout), f"no service {client.srv_name}"
    # A client may discover a service before the service discovers the client. The service waits
    # for only 0.1 s then, and its first response may be lost, so a request is sent again.
    for _ in range(attempts):
        future = client.call_async(request)
        with contextlib.suppress(TimeoutError):
            return finish(future, timeout)
        client.remove_pending_request(future)
    raise AssertionError(f"no answer from {client.srv_name}")


def finish(future: Any, timeout: float) -> Any:
    """Wait for the response of a call; raise TimeoutError after a timeout [s]."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if not done.wait(timeout):
        raise TimeoutError(f"no answer within {timeout} s")
    return future.result()
