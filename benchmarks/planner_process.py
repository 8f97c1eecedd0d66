"""A planner client for benchmarks that queries nodes in other processes and times them."""

import contextlib
import os
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath

import rclpy
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message

from msg_adapters.paths import stamped_pose
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_planner.demo.child_process import ChildProcess, stopping_children

SERVER = "/traverse_server/can_traverse"
ROOT = FilePath(__file__).resolve().parents[1]
DOMAIN = 101 + os.getpid() % 100
"""A ROS domain that tests do not use."""
TIMEOUT = 300.0
"""Longest wait for an answer [s]; the first may have to wait for compilation."""


class Planner:
    """Calls services for plans; its node spins in a separate thread."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=DOMAIN)
        self._node = Node("benchmark", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        self._clients: dict[str, object] = {}

    @property
    def node(self) -> Node:
        """The client node."""
        return self._node

    def ask(self, service: str, start, goal) -> tuple[Path, float]:
        """Return a plan between poses (3,), x, y [m], yaw [rad], and the response time [s]."""
        if service not in self._clients:
            self._clients[service] = self._node.create_client(GetPlan, service)
        client = self._clients[service]
        assert client.wait_for_service(TIMEOUT), f"no service {service}"
        request = GetPlan.Request(start=stamped_pose(start, "map"), goal=stamped_pose(goal, "map"))
        done = threading.Event()
        began = time.perf_counter()
        future = client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        assert done.wait(TIMEOUT), f"no answer from {service}"
        taken = time.perf_counter() - began
        return future.result().plan, taken

    def close(self) -> None:
        """End the node."""
        self._executor.shutdown()
        self._thread.join(5.0)
        rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()


class Processes:
    """Starts nodes in separate processes."""

    def __init__(
        self, children: list[ChildProcess], folder: FilePath, environment: Mapping[str, str]
    ):
        self._children, self._folder = children, folder
        self._environment = {
            **os.environ,
            **environment,
            "ROS_DOMAIN_ID": str(DOMAIN),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONPATH": str(ROOT),
        }

    def start_server(self, terrain: Terrain, **parameters: object) -> ChildProcess:
        """Start a traverse server with a map."""
        file = self._folder / "terrain.npz"
        save_terrain(file, terrain)
        parameters = {"terrain_file": file, **parameters}
        words = [w for name, value in parameters.items() for w in ("-p", f"{name}:={value}")]
        return self._start("rover_planner.nodes.traverse_server", "--ros-args", *words)

    def start_rover(
        self, terrain: Terrain, rate: float, start: Sequence[float], priority: int = 0
    ) -> None:
        """Start a simulated rover that drives straight ahead, and its traction controller.

        `start` is x, y [m], yaw [rad]; `rate` [Hz] and `priority` are the controller's parameters
        rate and realtime_priority.
        """
        file = self._folder / "rover_terrain.npz"
        save_terrain(file, terrain)
        for module, parameters in (
            (
                "rover_planner.nodes.traction_controller",
                {"rate": rate, "realtime_priority": priority, "enabled_at_start": True},
            ),
            (
                "rover_planner.nodes.rover_simulator",
                {
                    "rate": rate,
                    "terrain_file": file,
                    "start_x": start[0],
                    "start_y": start[1],
                    "follow_commands": True,
                },
            ),
        ):
            words = [w for name, value in parameters.items() for w in ("-p", f"{name}:={value}")]
            self._start(module, "--ros-args", *words)

    def start_echo(self, plan: Path) -> ChildProcess:
        """Start a node that answers with a plan."""
        file = self._folder / "plan.cdr"
        file.write_bytes(serialize_message(plan))
        return self._start("benchmarks.echo_node", str(file))

    def _start(self, module: str, *arguments: str) -> ChildProcess:
        log = self._folder / f"{module}{len(self._children)}.log"
        child = ChildProcess(module, arguments, self._environment, log)
        self._children.append(child)
        return child


@contextlib.contextmanager
def planner_and_processes(**environment: str) -> Iterator[tuple[Planner, Processes]]:
    """Yield a planner and a starter of nodes; all nodes are stopped at the end of the block.

    The nodes get the environment of this process plus the given variables.
    """
    with tempfile.TemporaryDirectory() as folder, stopping_children() as children:
        planner = Planner()
        try:
            yield planner, Processes(children, FilePath(folder), environment)
        finally:
            planner.close()


def memory_of(child: ChildProcess) -> float:
    """Return the peak memory of a process so far [MB]."""
    status = FilePath(f"/proc/{child.pid}/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024
