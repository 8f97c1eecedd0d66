# SPDX-License-Identifier: Apache-2.0
"""The node that asks the traverse server and lets a rover drive: their services and topics."""

import contextlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan
from rclpy.client import Client
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.identity import path_hash, plan_request_hash
from msg_adapters.paths import path_to_poses, poses_path, stamped_pose
from msg_adapters.results.predictions import array_values
from msg_adapters.sensors import odometry_to_pose
from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import DriveFailedError, NoAnswerError
from rover_planner.planning.answering.budget import STOPPING
from rover_planner.ros.qos import LATCHED_QOS, RESULT_QOS, SENSOR_QOS, SERVICE_QOS, TOPIC_QOS

REPEAT = 10.0
"""Time after which a question is asked again: the server may have been started anew [s]."""
NODE_NAME, SERVER = "mission_planner", "traverse_server"
"""Names of this node, and of the server's relative to its namespace; remap services and topics to
use another one."""
TEXTS = ("_hash", "_stamp", "server")
"""Ends of keys whose values are texts, even if they look like numbers."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The server's answer about a path."""

    traversable: bool
    """True if the rover can drive the path."""
    was_judged: bool
    """True if a path was judged; otherwise the question was refused."""
    code: str
    """Code of the reason; empty if it can."""
    reason: str
    """Why it cannot."""
    poses: list[list[float]]
    """x, y [m] and yaw [rad] along the path, map frame; empty without one."""
    report: dict[str, Any]
    """All that is told of it, as JSON types."""


class MissionPlanner(Node):
    """A node that asks a server, with the results that it publishes, and lets a rover drive.

    It takes messages only while it waits; nothing else is to spin it. Its methods raise
    NoAnswerError if what they wait for does not come in time.
    """

    def __init__(self, map_frame: str = "map", timeout: float = 60.0, **node_arguments: Any):
        """Create its topics and clients; `timeout` [s] is the longest wait for an answer."""
        super().__init__(NODE_NAME, **node_arguments)
        self.frame = map_frame
        """Frame of the map."""
        self._timeout = timeout
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self)
        self._verdict: dict[str, Any] = {}
        self._verdict_about: tuple[Any, Any] | None = None
        self._arrays: dict[str, np.ndarray] = {}
        self._asker = self.create_client(
            GetPlan, f"{SERVER}/can_traverse", qos_profile=SERVICE_QOS
        )
        self._checker = self.create_client(
            Trigger, f"{SERVER}/check_path", qos_profile=SERVICE_QOS
        )
        self._adviser = self.create_client(Trigger, f"{SERVER}/advise", qos_profile=SERVICE_QOS)
        self._server_parameters = AsyncParameterClient(self, SERVER)
        self._map_topic = self.create_publisher(PointCloud2, "elevation_cloud", LATCHED_QOS)
        self._path_topic = self.create_publisher(Path, f"{SERVER}/path", TOPIC_QOS)
        verdicts = self.create_subscription(
            DiagnosticArray, f"{SERVER}/verdict", self._take_verdict, RESULT_QOS
        )
        self._verdicts = verdicts.topic_name  # as remapped, which count_publishers does not do
        for name in ("wheel_loads", "slip_ratios"):
            take = partial(self._take_array, name)
            self.create_subscription(Float64MultiArray, f"{SERVER}/{name}", take, RESULT_QOS)
        self._pose: Floats | None = None
        self._sent = self._driven = ""
        self._paths: Publisher | None = None
        self._own_paths: set[str] = set()
        self._other_path = False
        self.create_subscription(Odometry, "odometry", self._take_odometry, SENSOR_QOS)
        driven = self.create_subscription(String, "path_driven", self._take_driven, LATCHED_QOS)
        self._driven_topic = driven.topic_name

    def wait_for_server(self) -> None:
        """Wait until the server's service and its verdict topic are connected."""
        self.wait(
            lambda: self._asker.service_is_ready() and self.count_publishers(self._verdicts) > 0,
            f"the service {self._asker.service_name} and the topic {self._verdicts}",
        )

    def publish_map(self, terrain: Terrain) -> None:
        """Publish a terrain for the server, once a node subscribes, and for later subscribers."""
        self.wait(lambda: self._map_topic.get_subscription_count() > 0, "a map subscriber")
        stamp = self.get_clock().now().to_msg()
        self._map_topic.publish(terrain_to_point_cloud(terrain, self.frame, stamp))

    def ask(self, start: Sequence[float], goal: Sequence[float]) -> Answer:
        """Ask whether the rover can drive from start to goal: x, y [m] and yaw [rad], map frame.

        Returns:
            The answer. Its report is the verdict by key, plus `plan` [[x, y, z], ...] [m], its
            `poses`, and `max_wheel_load` [N] and `max_slip_ratio` of the judged path, None if no
            path was judged.
        """
        deadline = time.monotonic() + self._timeout
        while True:
            try:
                answer = self._ask_once(start, goal)
                # the map may arrive later than the query, because it is sent on a topic
                if answer.code not in ("no_map", STOPPING) or time.monotonic() > deadline:
                    return answer
            except NoAnswerError:
                if time.monotonic() > deadline:
                    raise
            time.sleep(0.2)

    def _ask_once(self, start: Sequence[float], goal: Sequence[float]) -> Answer:
        self._arrays.clear()
        request = GetPlan.Request()
        request.start = stamped_pose(start, self.frame)
        request.goal = stamped_pose(goal, self.frame)
        plan = self._call(self._asker, request, REPEAT).plan
        # The hash tells this question from those of other clients, the stamp from earlier ones.
        about = plan.header.stamp, plan_request_hash(request.start, request.goal, 0.0)
        self.wait(lambda: self._verdict_about == about, f"the verdict on {self._verdicts}", REPEAT)
        verdict, positions = self._verdict, [pose.pose.position for pose in plan.poses]
        rows = verdict.get("predicted_waypoints", 0)
        report = verdict | {
            "plan": [[p.x, p.y, p.z] for p in positions],
            "poses": path_to_poses(plan, self.frame).tolist() if plan.poses else [],
            "max_wheel_load": self._largest("wheel_loads", rows),
            "max_slip_ratio": self._largest("slip_ratios", rows),
        }
        return _read_answer(verdict, report)

    def check(self, poses: Floats) -> Answer:
        """Return whether the rover can drive a path of poses (n, 3) now."""
        path, timeout = poses_path(poses, self.frame), self._timeout
        about, deadline = path_hash(path), time.monotonic() + timeout
        while time.monotonic() < deadline:
            self._path_topic.publish(path)
            with contextlib.suppress(NoAnswerError):
                told = json.loads(self._call(self._checker, Trigger.Request(), REPEAT).message)
                if told["path_hash"] == about:  # else it was an earlier one, or another client's
                    report = {key: told[key] for key in ("traversable", "reason")}
                    report |= {"poses": poses.tolist(), "waypoints": len(poses)}
                    return _read_answer(told, report)
        raise NoAnswerError(f"waited {timeout:.0f} s in vain for {self._checker.service_name}")

    def ask_advice(self) -> dict[str, Any]:
        """Return the advice on the path that was refused last; see docs/advice.md."""
        told = self._call(self._adviser, Trigger.Request()).message
        advice: dict[str, Any] = json.loads(told)
        return advice

    def set_policy(self, policy: str) -> None:
        """Let the server judge by another torque policy from now on."""
        changed = self._server_parameters.set_parameters([Parameter("policy", value=policy)])
        self.wait(changed.done, f"parameter policy of {SERVER}")

    def send_path(self, poses: Floats) -> None:
        """Let the rover follow a path of poses (n, 3), x, y [m] and yaw [rad], map frame.

        Raises:
            NoAnswerError: Another node sends paths, or none subscribes to them, for all the time.
        """
        paths = self._paths or self._take_rover()
        # One of those who hear it is this node.
        self.wait(lambda: paths.get_subscription_count() > 1, "a rover on the topic path")
        path = poses_path(poses, self.frame)
        self._sent, self._driven = path_hash(path), ""
        self._own_paths.add(self._sent)
        paths.publish(path)

    def _take_rover(self) -> Publisher:
        """Return the publisher of paths, once no other node publishes any."""
        topic = self.resolve_topic_name("path")
        others = ", ".join(one.node_name for one in self.get_publishers_info_by_topic(topic))
        if others:
            self.get_logger().warning(f"waiting: {others} sends the rover paths")
        self.wait(
            lambda: not self.count_publishers(topic),
            f"the end of {others}, which sends the rover paths",
        )
        self.create_subscription(Path, "path", self._hear_path, TOPIC_QOS)
        self._paths = self.create_publisher(Path, "path", TOPIC_QOS)
        return self._paths

    def _hear_path(self, path: Path) -> None:
        self._other_path |= path_hash(path) not in self._own_paths

    def has_ended(self) -> bool | None:
        """Return whether the follower is at the end of the path; None if it never says so."""
        if not self.count_publishers(self._driven_topic):
            return None
        return self._driven == self._sent

    def wait_for_pose(self, is_wanted: Callable[[Floats], bool], seconds: float) -> Floats:
        """Return the first measured pose (3,) that is wanted, or the last one after some seconds.

        Raises:
            DriveFailedError: Another node has sent the rover a path.
        """
        if self._other_path:
            raise DriveFailedError("another node has sent the rover a path, and drives it now")
        self.wait(lambda: self._pose is not None, "odometry")
        with contextlib.suppress(NoAnswerError):
            self.wait(lambda: is_wanted(np.array(self._pose)), "the rover", seconds)
        return np.array(self._pose)

    def _take_odometry(self, odometry: Odometry) -> None:
        try:
            pose, _ = odometry_to_pose(odometry, self.frame)
        except MessageError as error:
            self.get_logger().warning(f"odometry not used: {error}", once=True)
            return
        self._pose = pose[[0, 1, 5]]

    def _take_driven(self, message: String) -> None:
        self._driven = message.data

    def wait(self, condition: Callable[[], bool], what: str, timeout: float | None = None) -> None:
        """Take what has come, and what comes until a condition holds.

        Raises:
            NoAnswerError: It does not hold in time.
            ExternalShutdownException: ROS is shut down meanwhile.
        """
        longest = min(timeout or self._timeout, self._timeout)
        deadline = time.monotonic() + longest
        while self._take_next(0.0):
            pass
        while not condition():
            if time.monotonic() > deadline:
                raise NoAnswerError(f"waited {longest:.0f} s in vain for {what}")
            self._take_next(0.1)

    def _call(self, client: Client, request: Any, timeout: float | None = None) -> Any:
        """Return the response of a service."""
        answered = client.call_async(request)
        self.wait(answered.done, f"the answer of {client.service_name}", timeout)
        return answered.result()

    def _take_next(self, seconds: float) -> bool:
        """Take what comes next within some seconds; return whether anything came."""
        try:
            call, _, _ = self._executor.wait_for_ready_callbacks(timeout_sec=seconds)
        except TimeoutException:
            return False
        except Exception:
            if self.context.ok():
                raise
            raise ExternalShutdownException from None  # while it began to wait
        call()
        call.result()  # raises the error of a callback
        return True

    def _largest(self, name: str, rows: int) -> float | None:
        """Return the largest value of an array published with the verdict, None if it is empty."""
        if not rows:
            return None
        self.wait(lambda: len(self._arrays.get(name, ())) == rows, f"{SERVER}/{name}")
        values = self._arrays[name]
        return float(np.nanmax(values)) if np.isfinite(values).any() else None

    def _take_verdict(self, message: DiagnosticArray) -> None:
        self._verdict = {entry.key: _value(entry) for entry in message.status[0].values}
        self._verdict_about = message.header.stamp, self._verdict.get("question_hash")

    def _take_array(self, name: str, message: Float64MultiArray) -> None:
        self._arrays[name] = array_values(message)


def _read_answer(verdict: dict[str, Any], report: dict[str, Any]) -> Answer:
    """Return the answer of a verdict; its report has the path."""
    was_judged = "waypoints" in verdict
    told = {key: verdict[key] for key in ("traversable", "code", "reason")}
    return Answer(**told, was_judged=was_judged, poses=report["poses"], report=report)


def _value(entry: KeyValue) -> Any:
    """Parse a value of a diagnostic status as JSON; other texts are returned as they are."""
    if entry.key.endswith(TEXTS):
        return entry.value
    try:
        return json.loads(entry.value)
    except ValueError:
        return entry.value
