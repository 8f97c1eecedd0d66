"""A traverse server in a process of its own and clients in this one, on the same ROS domain."""

import contextlib
import json
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path as PathMessage
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import poses_path, stamped_pose
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_planner.demo.child_process import ChildProcess, stopping_children
from rover_planner.ros.qos import map_qos, service_qos, topic_qos
from support.ros_fixtures import RosRun, call, domain_id
from support.waiting import wait_until

SERVER = "/traverse_server"
ROOT = Path(__file__).resolve().parents[2]
ATTEMPTS = 15
"""Times that a response is asked for that may be lost, 2 s each."""
START_TIME = 300.0
"""Longest wait for a server [s], which may have to compile."""
HEAVY = {"waypoint_spacing": 0.001, "candidate_count": 99, "candidate_spacing": 0.01}
"""Parameters with which a question of some metres takes seconds."""

Pose = tuple[float, float, float]
"""x, y [m] and yaw [rad] of the body origin, map frame."""


class LostAnswerError(Exception):
    """A client has waited in vain for an answer."""


class Client:
    """A node that asks the server; it spins in a thread of its own."""

    def __init__(self, ros: RosRun, name: str):
        self.node = ros.spin(Node(name, context=ros.context))
        self.verdicts: list[DiagnosticArray] = []
        """Messages of ~/verdict since `hear_verdicts`."""
        self._plan = self.node.create_client(GetPlan, f"{SERVER}/can_traverse")
        self._check = self.node.create_client(
            Trigger, f"{SERVER}/check_path", qos_profile=service_qos()
        )
        self._cancel = self.node.create_client(Trigger, f"{SERVER}/cancel")
        self._parameters = self.node.create_client(SetParameters, f"{SERVER}/set_parameters")
        self._path = self.node.create_publisher(PathMessage, f"{SERVER}/path", topic_qos())

    def connect(self) -> None:
        """Wait until the server hears this client and its answers come back."""
        call(self._cancel, Trigger.Request(), START_TIME)
        wait_until(lambda: self._path.get_subscription_count() > 0, "~/path", START_TIME)
        for client in (self._plan, self._check, self._parameters):
            assert client.wait_for_service(START_TIME), client.srv_name
        # A response is lost if the server does not know the client yet; there is nothing that a
        # client could wait for.
        call(self._parameters, SetParameters.Request(), 2.0, ATTEMPTS)
        call(self._check, Trigger.Request(), 2.0, ATTEMPTS)

    def hear_verdicts(self) -> None:
        """Collect the messages of ~/verdict from now on."""
        deep = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(
            DiagnosticArray, f"{SERVER}/verdict", self.verdicts.append, deep
        )
        # A verdict that nobody hears gives way to the next one. The server knows the subscription
        # when it knows what this node created after it.
        after = self.node.create_client(SetParameters, f"{SERVER}/set_parameters")
        call(after, SetParameters.Request(), 2.0, ATTEMPTS)

    def publish(self, path: PathMessage) -> None:
        """Publish a path on ~/path."""
        self._path.publish(path)

    def begin_check(self) -> Any:
        """Call ~/check_path; return the future."""
        return self._check.call_async(Trigger.Request())

    def begin_plan(self, start: Pose, goal: Pose, tolerance: float = 0.0) -> Any:
        """Call ~/can_traverse; return the future."""
        return self._plan.call_async(plan_request(start, goal, tolerance))

    def check(self, timeout: float = 60.0) -> dict[str, Any]:
        """Return the verdict on the last path; raise LostAnswerError after a timeout [s]."""
        return json.loads(finish(self.begin_check(), timeout).message)

    def plan(self, start: Pose, goal: Pose, timeout: float = 60.0) -> PathMessage:
        """Return a plan; raise LostAnswerError after a timeout [s]."""
        return finish(self.begin_plan(start, goal), timeout).plan

    def cancel(self) -> Trigger.Response:
        """Call ~/cancel."""
        return finish(self._cancel.call_async(Trigger.Request()), 10.0)

    def set_parameter(self, name: str, value: float) -> bool:
        """Set a parameter of type double; return whether it was accepted."""
        told = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=told)])
        return finish(self._parameters.call_async(request), 10.0).results[0].successful


def plan_request(start: Pose, goal: Pose, tolerance: float = 0.0) -> GetPlan.Request:
    """Return a request to ~/can_traverse."""
    return GetPlan.Request(
        start=stamped_pose(start, "map"), goal=stamped_pose(goal, "map"), tolerance=tolerance
    )


def straight_path(start: Pose, goal: Pose) -> PathMessage:
    """Return a path of two poses."""
    return poses_path([start, goal], "map")


def finish(future: Any, timeout: float) -> Any:
    """Wait for the response of a call; raise LostAnswerError after a timeout [s]."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if not done.wait(timeout):
        raise LostAnswerError(f"no answer within {timeout} s")
    return future.result()


class MapSource:
    """A node that publishes maps transient-local, and hears the server's log."""

    def __init__(self, ros: RosRun):
        self.node = ros.spin(Node("map_source", context=ros.context))
        self.logs: list[str] = []
        self._cloud = self.node.create_publisher(PointCloud2, "elevation_cloud", map_qos())
        # Lines of before the server knows the subscription are heard, too.
        lines = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(Log, "/rosout", self._hear, lines)

    def publish(self, terrain: Terrain) -> None:
        """Publish a map."""
        self._cloud.publish(terrain_to_point_cloud(terrain, "map"))

    def give(self, terrain: Terrain, timeout: float = 20.0) -> float:
        """Publish a map; return the time [s] until the server says that it is in use."""
        wait_until(lambda: self._cloud.get_subscription_count() > 0, "the server", START_TIME)
        before = len(self.logs)
        began = time.perf_counter()
        self.publish(terrain)
        wait_until(lambda: any("map from" in log for log in self.logs[before:]), "map", timeout)
        return time.perf_counter() - began

    def _hear(self, log: Log) -> None:
        self.logs.append(log.msg)


class Stage:
    """Starts servers and clients; `open_stage` ends them."""

    def __init__(self, ros: RosRun, children: list[ChildProcess], folder: Path):
        self.ros, self._children, self._folder = ros, children, folder

    def client(self, name: str) -> Client:
        """Return a client that is connected to the server."""
        client = Client(self.ros, name)
        client.connect()
        return client

    def start_server(
        self,
        terrain: Terrain | None = None,
        environment: Mapping[str, str] | None = None,
        **parameters: object,
    ) -> ChildProcess:
        """Start a server.

        Args:
            terrain: Its map; None waits for one on the topic.
            environment: Additions to this process's environment.
            parameters: Its parameters. It tries candidates only, no search around obstacles.
        """
        parameters = {"planner": "fan", **parameters}
        if terrain is not None:
            file = self._folder / "terrain.npz"
            save_terrain(file, terrain)
            parameters["terrain_file"] = file
        words = [w for name, value in parameters.items() for w in ("-p", f"{name}:={value}")]
        child = ChildProcess(
            "rover_planner.nodes.traverse_server",
            ["--ros-args", *words] if words else [],
            {**os.environ, **server_environment(), **(environment or {})},
            self._folder / f"server{len(self._children)}.log",
        )
        self._children.append(child)
        return child

    def start_ready(self, terrain: Terrain | None = None, **parameters: object) -> ChildProcess:
        """Start a server and wait until it is ready."""
        child = self.start_server(terrain, **parameters)
        wait_for_log(child, "ready for rover")
        return child


def server_environment() -> dict[str, str]:
    """Return the environment of servers: the domain of the clients, and this checkout."""
    return {
        "ROS_DOMAIN_ID": str(domain_id()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONPATH": str(ROOT),
    }


def wait_for_log(child: ChildProcess, text: str) -> None:
    """Wait until a line of a server's log has a text in it; fail if the server ends before."""

    def heard() -> bool:
        told = child.log.read_text(errors="replace")
        assert text in told or child.running, f"the server has ended: {told}"
        return text in told

    wait_until(heard, f"the log line {text!r}", START_TIME)


@contextlib.contextmanager
def open_stage() -> Iterator[Stage]:
    """Yield a stage; all its processes and nodes are ended at the end of the block."""
    with tempfile.TemporaryDirectory() as folder, stopping_children() as children:
        ros = RosRun()
        try:
            yield Stage(ros, children, Path(folder))
        finally:
            ros.close()


def run_together(*functions: Callable[[], Any]) -> list[Any]:
    """Call functions in threads at once; return their results, or raise the first error."""
    results: list[Any] = [None] * len(functions)
    errors: list[Exception] = []

    def run(index: int) -> None:
        try:
            results[index] = functions[index]()
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(functions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]
    return results
