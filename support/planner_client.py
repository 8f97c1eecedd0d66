# SPDX-License-Identifier: Apache-2.0
"""A client of the traverse server for tests: publishes, calls, and keeps the results."""

import gc
import time
from functools import cache, partial
from weakref import WeakSet

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan, LoadMap
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.identity import path_hash
from msg_adapters.paths import poses_path, stamped_pose
from rover_physics.warm_up import warm_up
from rover_planner.nodes import traverse_server
from rover_planner.nodes import warm_up as kernels
from rover_planner.nodes.result_topics import RESULTS
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.ros.qos import LATCHED_QOS, RESULT_QOS, TOPIC_QOS
from support.messages import odometry_at
from support.ros_fixtures import RosRun, call
from support.waiting import wait_until

SERVER = "/traverse_server"
START, GOAL = (-2.0, 0.0, 0.0), (2.0, 0.3, 0.0)
"""Default poses of a query: x, y [m] and yaw [rad]."""
load_kernels = cache(warm_up)
"""Loads the kernels of questions, once in a process."""
_servers: WeakSet[TraverseServer] = WeakSet()


def spin_server(ros: RosRun, **overrides) -> TraverseServer:
    """Start a traverse server with parameters.

    Questions have more time than by default, so that a busy machine makes no difference; kernels
    that a test needs later are loaded when it does. Maps are loaded from any folder. Waypoints are
    farther apart, so that a question takes less work.
    """
    load_kernels()
    if _servers:
        gc.collect()  # one that is collected later would end the log of this one
    values = {"time_budget": 60.0, "map_folder": "/", "waypoint_spacing": 0.05} | overrides
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "LOADING_DELAY", 1e6)
        patch.setattr(traverse_server, "EXACT", ())
        server = ros.start(TraverseServer, **values)
    _servers.add(server)
    return server


class PlannerClient(Node):
    """A node with the counterparts of all topics and services of the traverse server."""

    def __init__(self, ros: RosRun):
        super().__init__("test_planner", context=ros.context)
        self.heard: dict[str, list] = {topic: [] for topic in RESULTS}
        self.logs: list[str] = []
        self._answers, self._counts = 0, dict.fromkeys(RESULTS, 0)
        for topic, (kind, _) in RESULTS.items():
            self.create_subscription(
                kind, f"{SERVER}/{topic}", partial(self._hear, topic), RESULT_QOS
            )
        self.create_subscription(Log, "/rosout", lambda log: self.logs.append(log.msg), 100)
        self.stops: list[tuple[bool, float]] = []
        """Each stop heard, and when [s]."""
        self.create_subscription(Bool, f"{SERVER}/stop", self._hear_stop, LATCHED_QOS)
        self._plan = self.create_client(GetPlan, f"{SERVER}/can_traverse")
        self._check = self.create_client(Trigger, f"{SERVER}/check_path")
        self._map = self.create_client(LoadMap, f"{SERVER}/load_map")
        self._parameters = self.create_client(SetParameters, f"{SERVER}/set_parameters")
        self._cloud = self.create_publisher(PointCloud2, "elevation_cloud", LATCHED_QOS)
        self._path = self.create_publisher(Path, f"{SERVER}/path", TOPIC_QOS)
        self._joints = self.create_publisher(JointState, "joint_states", TOPIC_QOS)
        self._odometry = self.create_publisher(Odometry, "odometry", TOPIC_QOS)

    def send_cloud(self, cloud: PointCloud2) -> None:
        """Publish a cloud unchanged."""
        self.send(self._cloud, cloud)

    def send_terrain(self, terrain) -> None:
        """Publish a terrain and wait until the server has it."""
        self.logs.clear()
        self.send_cloud(terrain_to_point_cloud(terrain, "map"))
        self.wait_for_log("map from elevation_cloud")

    def send_path(self, path: Path) -> None:
        """Publish a path."""
        self.send(self._path, path)

    def send_joints(self, names, positions) -> None:
        """Publish joint positions."""
        self.send(self._joints, JointState(name=list(names), position=list(positions)))

    def can_traverse(self, start, goal) -> Path:
        """Ask for a plan between two poses (3,)."""
        return self.plan(stamped_pose(start, "map"), stamped_pose(goal, "map"))

    def plan(self, start, goal) -> Path:
        """Ask for a plan between two PoseStamped."""
        plan = call(self._plan, GetPlan.Request(start=start, goal=goal)).plan
        self._answers += 1
        return plan

    def check_path(self) -> Trigger.Response:
        """Call ~/check_path for the last path."""
        response = call(self._check, Trigger.Request())
        self._answers += 1
        return response

    def check_poses(self, server, poses) -> Trigger.Response:
        """Publish a path of poses (n, 3), wait until the server has it, and check it."""
        path = poses_path(poses, "map")
        self.send_path(path)
        wait_until(lambda: server.service.given_path.hash == path_hash(path), "the path")
        return self.check_path()

    def load_map(self, url: str) -> LoadMap.Response:
        """Call ~/load_map with the URL of a terrain file."""
        return call(self._map, LoadMap.Request(map_url=str(url)))

    def set_parameter(self, name: str, value) -> tuple[bool, str]:
        """Set a parameter; return whether it was accepted, and the reason if not."""
        parameters = [Parameter(name, value=value).to_parameter_msg()]
        result = call(self._parameters, SetParameters.Request(parameters=parameters)).results[0]
        return result.successful, result.reason

    def next_results(self, ask) -> tuple:
        """Call `ask` and return its answer with the results published for it.

        Results are published after an answer, and topics have no order. This method therefore
        first waits for the results of the questions before.
        """
        wait_until(self._has_all, "the results of the questions before")
        for messages in self.heard.values():
            messages.clear()
        answer = ask()
        # A response that was lost is asked for again: the results of the first one may come late.
        wait_until(lambda: self._has_all() and all(self.heard.values()), "all results")
        return answer, {topic: messages[-1] for topic, messages in self.heard.items()}

    def stand(self, pose, height=0.0) -> None:
        """Publish odometry of a level pose (3,) from now on."""
        odometry = odometry_at(pose, height)
        self.create_timer(0.05, lambda: self._odometry.publish(odometry))

    @property
    def silence(self) -> float:
        """Time since the last stop was heard [s]."""
        return time.monotonic() - self.stops[-1][1]

    def wait_for_stop(self, value: bool = True) -> None:
        """Wait until the last stop has a value."""
        wait_until(lambda: self.stops and self.stops[-1][0] == value, f"stop {value}")

    def _hear_stop(self, stop: Bool) -> None:
        self.stops.append((stop.data, time.monotonic()))

    def _hear(self, topic: str, message) -> None:
        self.heard[topic].append(message)
        self._counts[topic] += 1

    def _has_all(self) -> bool:
        """Return whether all topics have the same number of answers, and all of this node."""
        return len(set(self._counts.values())) == 1 and self._counts["plan"] >= self._answers

    def wait_for_log(self, text: str) -> None:
        """Wait for a log line of the server with a text in it."""
        wait_until(lambda: any(text in line for line in self.logs), f"a log line with {text!r}")

    def wait_for_verdict(self) -> dict[str, str]:
        """Wait for a verdict; return its keys and values."""
        wait_until(lambda: self.heard["verdict"], "the verdict")
        return verdict_of(self.heard["verdict"][-1])

    def send(self, publisher, message) -> None:
        """Publish a message as soon as someone hears it."""
        wait_until(lambda: publisher.get_subscription_count() > 0, publisher.topic_name)
        publisher.publish(message)


def begin_plan(ros: RosRun, start=START, goal=GOAL) -> tuple[GetPlan.Request, Future]:
    """Ask for a plan from a node of its own, without waiting; return request and future."""
    asker = ros.spin(Node("asker", context=ros.context))
    service = asker.create_client(GetPlan, f"{SERVER}/can_traverse")
    assert service.wait_for_service(20.0)
    request = GetPlan.Request(start=stamped_pose(start, "map"), goal=stamped_pose(goal, "map"))
    return request, service.call_async(request)


def verdict_of(message: DiagnosticArray) -> dict[str, str]:
    """Return the keys and values of a message of ~/verdict."""
    return {entry.key: entry.value for entry in message.status[0].values}


def ask(client: PlannerClient, start=START, goal=GOAL):
    """Ask for a plan; return it with its verdict and results."""
    plan, results = client.next_results(lambda: client.can_traverse(start, goal))
    return plan, verdict_of(results["verdict"]), results
