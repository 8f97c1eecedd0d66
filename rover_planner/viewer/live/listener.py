# SPDX-License-Identifier: Apache-2.0
"""A node that listens to a rover and its planner, and keeps the latest data for the page."""

import contextlib
import copy
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64MultiArray, String

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.frames import read_orientation
from msg_adapters.identity import plan_request_hash
from msg_adapters.paths import path_to_poses, stamped_pose
from msg_adapters.results.diagnostics import HEALTH
from msg_adapters.results.predictions import array_values
from rover_physics.errors import RoverError
from rover_physics.names import WHEEL_JOINTS
from rover_planner.errors import PlanningError
from rover_planner.planning.learned_ground import parse_learned
from rover_planner.ros.qos import (
    LATCHED_QOS,
    RESULT_QOS,
    SENSOR_QOS,
    SERVICE_QOS,
    TOPIC_QOS,
    map_subscriptions,
)
from rover_planner.viewer.live.live_state import (
    CLICK,
    ODOMETRY,
    SIGN_OF_LIFE,
    LiveData,
    LiveQuestion,
    TopicAge,
    add_to_trail,
)

SERVER, CONTROLLER = "/traverse_server", "/traction_controller"
PREDICTED_FIELDS = {
    "wheel_loads": "wheel_loads",
    "friction_utilisation": "friction_utilisation",
    "slip_ratios": "slip_ratio",
    "tip_over_margin": "tip_over_ratio",
}
"""Topics of the server with a row for each waypoint, and the quantity each fills."""
ESTIMATED_FIELDS = ("wheel_loads", "friction_utilisation", "contact_angles")
"""Topics of the controller, and the quantities they tell in place of predictions."""
Take = Callable[[Any], None]
"""Takes a message."""


class LiveListener(Node):
    """Keeps the latest values, map, plan and verdict; it skips bad messages with a warning.

    Messages come in one thread and are asked for in another: a lock guards the data.
    """

    def __init__(self, map_frame: str = "map", **node_arguments: Any):
        """Subscribe to the topics of a rover, a traverse_server and a traction_controller."""
        super().__init__("rover_view", **node_arguments)
        self._frame, self._lock = map_frame, threading.Lock()
        self._data = LiveData()
        """Without the forces."""
        self._predicted: dict[str, np.ndarray] = {}
        self._estimated: dict[str, np.ndarray] = {}
        self._worked_at: float | None = None
        """Stamp of the last rates of the wheels [s]."""
        self._planner = self.create_client(
            GetPlan, f"{SERVER}/can_traverse", qos_profile=SERVICE_QOS
        )
        self._subscribe()

    def _subscribe(self) -> None:
        sensors, results, numbers = SENSOR_QOS, RESULT_QOS, Float64MultiArray
        self._listen(JointState, "joint_states", self._on_joint_states, sensors, is_stream=True)
        self._listen(Odometry, ODOMETRY, self._on_odometry, sensors, is_stream=True)
        for qos, _ in map_subscriptions("either"):
            self._listen(PointCloud2, "elevation_cloud", self._on_cloud, qos)
        self._listen(Path, f"{SERVER}/plan", self._on_plan, results)
        self._listen(DiagnosticArray, f"{SERVER}/verdict", self._on_verdict, results)
        self._listen(String, f"{SERVER}/ground_estimate", self._on_ground, LATCHED_QOS)
        for topic, field in PREDICTED_FIELDS.items():
            take = partial(self._on_prediction, field)
            self._listen(numbers, f"{SERVER}/{topic}", take, results)
        for field in ESTIMATED_FIELDS:
            take = partial(self._on_estimate, field)
            self._listen(numbers, f"{CONTROLLER}/{field}", take, TOPIC_QOS, is_stream=True)
        self._data.ages[SIGN_OF_LIFE] = TopicAge(None, True)
        self.create_subscription(DiagnosticArray, "diagnostics", self._on_diagnostics, TOPIC_QOS)

    def _listen(
        self, kind: Any, topic: str, take: Take, qos: QoSProfile, *, is_stream: bool = False
    ) -> None:
        """Subscribe to a topic and note the age of its messages."""
        age = self._data.ages[topic] = TopicAge(None, is_stream)

        def hear(message: Any) -> None:
            age.heard = time.monotonic()
            self._hear(topic, take, message)

        self.create_subscription(kind, topic, hear, qos)

    def _hear(self, what: str, take: Take, message: Any) -> None:
        """Take a message, or warn of one that is bad."""
        try:
            with self._lock:
                take(message)
        except RoverError as error:
            self.get_logger().warning(f"{what} not shown: {error}", throttle_duration_sec=1.0)

    def latest(self) -> LiveData:
        """Return the latest data."""
        with self._lock:
            data = copy.copy(self._data)
            predicted, estimated = self._predicted.copy(), self._estimated.copy()
        for field in ESTIMATED_FIELDS:
            if data.ages[f"{CONTROLLER}/{field}"].is_stale:
                estimated.pop(field, None)
        if data.plan is None or data.position is None or data.ages[SIGN_OF_LIFE].is_stale:
            predicted = {}
        else:
            predicted = _read_nearest(predicted, data.plan, data.position)
        if not estimated.keys().isdisjoint(PREDICTED_FIELDS.values()):
            data.forces_from = "forces estimated by the traction controller"
        elif predicted:
            data.forces_from = "forces predicted by the server"
        data.forces = {**predicted, **estimated}
        return data

    def request_plan(self, goal: np.ndarray) -> None:
        """Ask the server for a plan from the rover's pose to a goal (2,) [m].

        Plan and verdict come on their topics.

        Raises:
            PlanningError: There is no odometry, or no server.
        """
        data = self._data
        if data.position is None:
            raise PlanningError("no odometry yet, so the start is not known")
        if not self._planner.service_is_ready():
            raise PlanningError(f"no service {SERVER}/can_traverse")
        yaw = float(np.arctan2(*(np.asarray(goal) - data.position[:2])[::-1]))
        start = (*data.position[:2], data.attitude[2])
        request = GetPlan.Request(
            start=stamped_pose(start, self._frame), goal=stamped_pose((*goal, yaw), self._frame)
        )
        hashed = plan_request_hash(request.start, request.goal, 0.0)
        self._data.click = click = LiveQuestion(CLICK, hashed, time.monotonic())
        take = partial(self._on_answer, click)
        self._planner.call_async(request).add_done_callback(partial(self._hear, "plan", take))

    def forget_click(self) -> None:
        """Follow the server's newest verdict again."""
        self._data.click = None

    def _on_answer(self, click: LiveQuestion, future: Any) -> None:
        """Take the plan of a click."""
        plan = future.result().plan
        if plan.poses:
            click.plan = path_to_poses(plan, self._frame)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if any(status.name == HEALTH for status in message.status):
            self._data.ages[SIGN_OF_LIFE].heard = time.monotonic()

    def _on_joint_states(self, state: JointState) -> None:
        """Take angles and torques, and the work of the wheel motors since their last rates."""
        data, now = self._data, state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        joints, efforts, rates = (
            _name_finite(state.name, values)
            for values in (state.position, state.effort, state.velocity)
        )
        data.joints, data.efforts = {**data.joints, **joints}, {**data.efforts, **efforts}
        if rates:
            last = now if self._worked_at is None else self._worked_at
            passed, self._worked_at = max(now - last, 0.0), max(now, last)
            motors = ((data.efforts.get(name, 0.0), rates.get(name, 0.0)) for name in WHEEL_JOINTS)
            data.time += passed
            data.energy += passed * sum(max(effort * rate, 0.0) for effort, rate in motors)

    def _on_odometry(self, odometry: Odometry) -> None:
        place, data = odometry.pose.pose.position, self._data
        attitude = read_orientation(odometry.pose.pose.orientation, "odometry orientation")
        position = np.array([place.x, place.y, place.z])
        if np.isfinite(position).all():
            before = position if data.position is None else data.position
            data.distance += float(np.hypot(*(position - before)[:2]))
            data.position, data.attitude = position, np.array(attitude)
            data.speed = float(odometry.twist.twist.linear.x)

    def _on_cloud(self, cloud: PointCloud2) -> None:
        self._data.terrain = terrain_from_point_cloud(cloud)

    def _on_ground(self, message: String) -> None:
        data = self._data
        data.learned = parse_learned(message.data, "ground_estimate")
        if data.position is not None:
            data.trail = add_to_trail(data.trail, data.position[:2], data.learned)

    def _on_plan(self, plan: Path) -> None:
        self._data.plan = path_to_poses(plan, self._frame) if plan.poses else None

    def _on_verdict(self, message: DiagnosticArray) -> None:
        """Take a verdict; it is that of the last click, too, if that asked the same."""
        if not message.status:
            return
        status, now, click = message.status[0], time.monotonic(), self._data.click
        self._data.ages[SIGN_OF_LIFE].heard = now
        about = {one.key: one.value for one in status.values}
        passes = status.level != DiagnosticStatus.ERROR
        name = f"question {about.get('request', '?')}, {about.get('service', '?')}"
        reason, hashed = "" if passes else status.message, about.get("question_hash", "")
        self._data.newest = LiveQuestion(name, hashed, now, passes, reason)
        if click is not None and click.traversable is None and click.hash == hashed:
            click.since, click.reason, click.traversable = now, reason, passes

    def _on_prediction(self, field: str, message: Float64MultiArray) -> None:
        self._predicted[field] = array_values(message).copy()

    def _on_estimate(self, field: str, message: Float64MultiArray) -> None:
        if len(message.data) >= 6:  # deviations may follow
            self._estimated[field] = np.array(message.data[:6])


def _name_finite(names: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    """Return the finite values by name; none where they are not one for each name."""
    if len(values) != len(names):
        return {}
    pairs = zip(names, values, strict=True)
    return {name: value for name, value in pairs if math.isfinite(value)}


def _read_nearest(
    predicted: Mapping[str, np.ndarray], plan: np.ndarray, position: np.ndarray
) -> dict[str, Any]:
    """Return the predicted values, by field, at the waypoint of a plan nearest to a position."""
    away = np.hypot(*(plan[:, :2] - position[:2]).T)
    share = int(np.argmin(away)) / max(len(away) - 1, 1)
    nearest = {
        field: rows[round(share * (len(rows) - 1))]
        for field, rows in predicted.items()
        if len(rows)
    }
    if "tip_over_ratio" in nearest:
        nearest["tip_over_ratio"] = float(nearest["tip_over_ratio"][0])
    return nearest


@contextlib.contextmanager
def listen(context: Context | None = None) -> Iterator[LiveListener]:
    """Yield a listener that is spun in the background; without a context it has one of its own."""
    own = context or Context()
    if context is None:
        rclpy.init(context=own)
    listener, executor = LiveListener(context=own), SingleThreadedExecutor(context=own)
    executor.add_node(listener)
    ended = threading.Event()

    def spin() -> None:
        # Not executor.spin(): at times that does not return from executor.shutdown().
        with contextlib.suppress(ExternalShutdownException):
            while not ended.is_set():
                executor.spin_once(timeout_sec=0.2)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield listener
    finally:
        ended.set()
        executor.wake()
        thread.join(5.0)
        executor.shutdown()
        listener.destroy_node()
        if context is None:
            own.try_shutdown()
