# SPDX-License-Identifier: Apache-2.0
"""Nodes in processes of their own, and clients in this one, on a ROS domain of their own.

`python -m benchmarks.processes PLAN` is a node that answers GetPlan with a stored plan (a file
with a serialised nav_msgs/Path): the cost of the service alone.
"""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import rclpy
from nav_msgs.msg import Path as PathMessage
from nav_msgs.srv import GetPlan
from rcl_interfaces.srv import SetParameters
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from std_srvs.srv import Trigger

from msg_adapters.paths import stamped_pose
from rover_physics import Terrain, save_terrain
from rover_planner.demo.child_process import ChildProcess, stopping_children
from rover_planner.ros.qos import SERVICE_QOS, TOPIC_QOS
from support.project.checkout import TOP
from support.ros_fixtures import RosRun, call, finish
from support.waiting import wait_until

SERVER, CONTROLLER, ECHO = "traverse_server", "traction_controller", "echo"
DOMAIN = 101 + os.getpid() % 100
"""A ROS domain that tests do not use."""
START_TIME = 300.0
"""Longest wait for a node or its first answer [s]; it may have to compile."""
STOP_TIMEOUT = 0.4
"""Time without the watch after which a controller stops the rover, as in the launch files [s]."""
ATTEMPTS = 15
"""Times that a response is asked for that may be lost, 2 s each."""

Pose = tuple[float, float, float]
"""x, y [m] and yaw [rad] of the body origin, map frame."""


class NodeProcesses:
    """Starts nodes and clients; `open_nodes` ends them."""

    def __init__(self, ros: RosRun, children: list[ChildProcess], folder: Path):
        self.ros, self.folder, self._children = ros, folder, children

    def client(self, name: str = "benchmark") -> "Client":
        """Return a client in this process."""
        return Client(self.ros, name)

    def start_module(
        self, module: str, *words: str, environment: Mapping[str, str] | None = None
    ) -> ChildProcess:
        """Start a module of this checkout, with additions to this process's environment."""
        settings = {"ROS_DOMAIN_ID": str(DOMAIN), "PYTHONPATH": str(TOP)}
        settings |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"} | dict(environment or {})
        log = self.folder / f"{len(self._children)}.log"
        child = ChildProcess(module, words, os.environ | settings, log)
        self._children.append(child)
        return child

    def start(
        self, node: str, environment: Mapping[str, str] | None = None, **parameters: Any
    ) -> ChildProcess:
        """Start a node of rover_planner with parameters; a Terrain is written to a file."""
        words = []
        for name, value in parameters.items():
            if isinstance(value, Terrain):
                file = self.folder / f"{node}.npz"
                save_terrain(file, value)
                value = file
            words += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        words = ["--ros-args", *words] if words else []
        return self.start_module(f"rover_planner.nodes.{node}", *words, environment=environment)

    def start_echo(self, plan: PathMessage) -> ChildProcess:
        """Start a node that answers with a plan."""
        file = self.folder / "plan.cdr"
        file.write_bytes(serialize_message(plan))
        return self.start_module("benchmarks.processes", str(file))


@contextlib.contextmanager
def open_nodes() -> Iterator[NodeProcesses]:
    """Yield what starts nodes; all processes and nodes are ended at the end of the block."""
    with tempfile.TemporaryDirectory() as folder, stopping_children() as children:
        ros = RosRun(DOMAIN)
        try:
            yield NodeProcesses(ros, children, Path(folder))
        finally:
            ros.close()


class Client:
    """A node that asks a traverse server; it spins in a thread of its own."""

    def __init__(self, ros: RosRun, name: str):
        self.node = ros.spin(Node(name, context=ros.context))
        plans = (SERVER, ECHO)
        self._plans = {n: self.node.create_client(GetPlan, f"/{n}/can_traverse") for n in plans}
        self._check = self.node.create_client(
            Trigger, f"/{SERVER}/check_path", qos_profile=SERVICE_QOS
        )
        self._cancel = self.node.create_client(Trigger, f"/{SERVER}/cancel")
        self._parameters = self.node.create_client(SetParameters, f"/{SERVER}/set_parameters")
        self._path = self.node.create_publisher(PathMessage, f"/{SERVER}/path", TOPIC_QOS)

    def connect(self) -> "Client":
        """Wait until the server hears this client and its answers come back; return itself."""
        call(self._cancel, Trigger.Request(), START_TIME)
        wait_until(lambda: self._path.get_subscription_count() > 0, "~/path", START_TIME)
        for client in (self._plans[SERVER], self._check, self._parameters):
            assert client.wait_for_service(START_TIME), client.srv_name
        # A response is lost if the server does not know the client yet; there is nothing that a
        # client could wait for.
        call(self._parameters, SetParameters.Request(), 2.0, ATTEMPTS)
        call(self._check, Trigger.Request(), 2.0, ATTEMPTS)
        return self

    def publish(self, path: PathMessage) -> None:
        """Publish a path on ~/path."""
        self._path.publish(path)

    def begin_check(self) -> Any:
        """Call ~/check_path; return the future."""
        return self._check.call_async(Trigger.Request())

    def check(self, timeout: float = 60.0) -> dict[str, Any]:
        """Return the verdict on the last path; raise TimeoutError after a timeout [s]."""
        return json.loads(finish(self.begin_check(), timeout).message)

    def plan(
        self, start: Pose, goal: Pose, timeout: float = START_TIME, node: str = SERVER
    ) -> PathMessage:
        """Return a plan; raise TimeoutError after a timeout [s]."""
        ends = {"start": stamped_pose(start, "map"), "goal": stamped_pose(goal, "map")}
        return finish(self._plans[node].call_async(GetPlan.Request(**ends)), timeout).plan

    def first_plan(self, start: Pose, goal: Pose, node: str = SERVER) -> PathMessage:
        """Wait for the service, then return a plan."""
        assert self._plans[node].wait_for_service(START_TIME), f"no service of {node}"
        return self.plan(start, goal, node=node)

    def set_parameter(self, name: str, value: object) -> bool:
        """Set a parameter of the server; return whether it was accepted."""
        parameters = [Parameter(name, value=value).to_parameter_msg()]
        request = SetParameters.Request(parameters=parameters)
        return finish(self._parameters.call_async(request), 10.0).results[0].successful


def memory_of(child: ChildProcess | subprocess.Popen, kind: str = "VmRSS") -> float:
    """Return the memory that a process holds now [MB], or its peak for the kind VmHWM."""
    lines = Path(f"/proc/{child.pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(kind)) / 1024


def serve_plan(file: Path) -> None:
    """Answer with the plan of a file until interrupted."""
    plan = deserialize_message(file.read_bytes(), PathMessage)
    rclpy.init()
    node = Node(ECHO)

    def answer(_request: GetPlan.Request, response: GetPlan.Response) -> GetPlan.Response:
        response.plan = plan
        return response

    node.create_service(GetPlan, "~/can_traverse", answer)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    rclpy.try_shutdown()


if __name__ == "__main__":
    serve_plan(Path(sys.argv[1]))
