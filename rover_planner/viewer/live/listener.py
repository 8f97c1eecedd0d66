# SPDX-License-Identifier: Apache-2.0
"""A node that listens to a rover and its planner, and keeps the latest data for the page."""

import contextlib
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
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
from std_msgs.msg import Float64MultiArray

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.paths import path_to_poses, stamped_pose, yaw_from_quaternion
from msg_adapters.results.predictions import array_values
from rover_physics.errors import RoverError
from rover_physics.names import WHEEL_JOINTS
from rover_physics.numerics.quaternions import rpy_from_xyzw
from rover_physics.terrain.grid import Terrain
from rover_planner.ros.qos import (
    map_subscriptions_qos,
    result_qos,
    sensor_qos,
    service_qos,
    topic_qos,
)
from rover_planner.viewer.live.live_state import LiveValues
from rover_planner.viewer.live.topic_ages import TopicAge, TopicAges

SERVER, CONTROLLER = "/traverse_server", "/traction_controller"
ODOMETRY = "odometry"
NO_ODOMETRY = TopicAge(ODOMETRY, None, True)
PREDICTED_FIELDS = {
    "wheel_loads": "wheel_loads",
    "friction_utilisation": "friction_utilisation",
    "slip_ratios": "slip_ratio",
    "tip_over_margin": "tip_over_ratio",
}
"""Topics of the server with a row for each waypoint, and the field of LiveValues each fills."""
ESTIMATED_FIELDS = {"wheel_loads": "wheel_loads", "friction_utilisation": "friction_utilisation"}
"""Topics of the controller and the fields they fill, in place of predictions."""


@dataclass(frozen=True)
class LiveVerdict:
    """The last verdict of the server."""

    traversable: bool
    """Whether there is a path that the rover can drive."""
    reason: str
    """Why not, empty where there is one."""


@dataclass(frozen=True, eq=False)
class LiveData:
    """The latest data; None for what has not come."""

    values: LiveValues
    """Of the rover."""
    terrain: Terrain | None
    """The map."""
    plan: np.ndarray | None
    """(n, 3) poses of the plan, x, y [m], yaw [rad]."""
    verdict: LiveVerdict | None
    """The verdict of the server."""
    ages: tuple[TopicAge, ...] = ()
    """The ages of all topics."""

    @property
    def odometry(self) -> TopicAge:
        """The age of the odometry, without which nothing here is live."""
        return next((one for one in self.ages if one.topic == ODOMETRY), NO_ODOMETRY)


class LiveListener(Node):
    """Keeps the latest values, map, plan and verdict; it skips bad messages with a warning."""

    def __init__(self, map_frame: str = "map", **node_arguments: Any):
        """Subscribe to the topics of a rover, a traverse_server and a traction_controller."""
        super().__init__("rover_view", **node_arguments)
        self._frame = map_frame
        self._lock = threading.Lock()
        self._values = LiveValues()
        self._predicted: dict[str, np.ndarray] = {}
        self._terrain: Terrain | None = None
        self._plan: np.ndarray | None = None
        self._verdict: LiveVerdict | None = None
        self._estimated: set[str] = set()
        self._ages = TopicAges()
        self._first_time: float | None = None
        self._planner = self.create_client(
            GetPlan, f"{SERVER}/can_traverse", qos_profile=service_qos()
        )
        self._subscribe_to_rover()
        self._subscribe_to_server()
        self._subscribe_to_controller()

    def _subscribe_to_rover(self) -> None:
        sensors = sensor_qos()
        self._listen(JointState, "joint_states", self._on_joint_states, sensors, is_stream=True)
        self._listen(Odometry, ODOMETRY, self._on_odometry, sensors, is_stream=True)
        for qos in map_subscriptions_qos("either"):
            self._listen(PointCloud2, "elevation_cloud", self._on_cloud, qos)

    def _listen(
        self,
        kind: Any,
        topic: str,
        take: Callable[[Any], None],
        qos: QoSProfile,
        *,
        is_stream: bool = False,
    ) -> None:
        """Subscribe to a topic and note the age of its messages."""
        self._ages.expect(topic, is_stream=is_stream)

        def hear(message: Any) -> None:
            self._ages.hear(topic)
            take(message)

        self.create_subscription(kind, topic, hear, qos)

    def _subscribe_to_server(self) -> None:
        qos = result_qos()
        self._listen(Path, f"{SERVER}/plan", self._on_plan, qos)
        self._listen(DiagnosticArray, f"{SERVER}/verdict", self._on_verdict, qos)
        for topic, field in PREDICTED_FIELDS.items():
            take = self._on_prediction_of(field)
            self._listen(Float64MultiArray, f"{SERVER}/{topic}", take, qos)

    def _subscribe_to_controller(self) -> None:
        qos = topic_qos()
        takes = {name: self._on_estimate_of(field) for name, field in ESTIMATED_FIELDS.items()}
        takes["contact_angles"] = self._on_contact_angles
        for name, take in takes.items():
            self._listen(Float64MultiArray, f"{CONTROLLER}/{name}", take, qos, is_stream=True)

    def latest(self) -> LiveData:
        """Return the latest data."""
        ages = tuple(self._ages.list_all())
        with self._lock:
            self._forget_stale_estimates()
            self._fill_from_prediction()
            values = self._values.copy()
            return LiveData(values, self._terrain, self._plan, self._verdict, ages)

    def _forget_stale_estimates(self) -> None:
        """Drop forces that the controller no longer publishes, so that none looks like now."""
        for topic, field in ESTIMATED_FIELDS.items():
            if field in self._estimated and self._ages.is_stale(f"{CONTROLLER}/{topic}"):
                self._estimated.discard(field)
                setattr(self._values, field, np.full(6, np.nan))
                self._values.forces_from = ""

    def request_plan(self, goal: np.ndarray) -> str:
        """Ask the server for a plan from the rover's pose to a goal (2,) [m].

        Returns:
            Why that is not possible, empty if it is; plan and verdict come on their topics.
        """
        with self._lock:
            values = self._values.copy()
        if values.position is None:
            return "no odometry yet, so the start is not known"
        if not self._planner.service_is_ready():
            return f"no service {SERVER}/can_traverse"
        yaw = float(np.arctan2(*(np.asarray(goal) - values.position[:2])[::-1]))
        start = (*values.position[:2], values.attitude[2])
        request = GetPlan.Request(
            start=stamped_pose(start, self._frame), goal=stamped_pose((*goal, yaw), self._frame)
        )
        self._planner.call_async(request)
        return ""

    def _fill_from_prediction(self) -> None:
        """Take fields without estimates from the prediction at the rover's nearest waypoint."""
        values = self._values
        if self._plan is None or values.position is None:
            return
        away = np.hypot(*(self._plan[:, :2] - values.position[:2]).T)
        share = int(np.argmin(away)) / max(len(away) - 1, 1)
        for field, rows in self._predicted.items():
            if field in self._estimated or not len(rows):
                continue
            row = rows[round(share * (len(rows) - 1))]
            setattr(values, field, float(row[0]) if field == "tip_over_ratio" else row)
            values.forces_from = values.forces_from or "forces predicted by the server"

    def _on_joint_states(self, state: JointState) -> None:
        with self._lock:
            for values, into in (
                (state.position, self._values.joints),
                (state.effort, self._values.efforts),
            ):
                if len(values) == len(state.name):
                    pairs = zip(state.name, values, strict=True)
                    into.update({name: value for name, value in pairs if math.isfinite(value)})
            if len(state.velocity) == len(state.name):
                self._add_work(dict(zip(state.name, state.velocity, strict=True)), state)

    def _add_work(self, rates: dict[str, float], state: JointState) -> None:
        """Add the work of the wheel motors since the last message, rates [rad/s] by joint name."""
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        self._first_time = now if self._first_time is None else self._first_time
        passed = now - self._first_time - self._values.time
        if passed > 0.0:
            power = sum(
                max(self._values.efforts.get(name, 0.0) * rates.get(name, 0.0), 0.0)
                for name in WHEEL_JOINTS
            )
            self._values.energy += power * passed
            self._values.time += passed

    def _on_odometry(self, odometry: Odometry) -> None:
        point, q = odometry.pose.pose.position, odometry.pose.pose.orientation
        try:
            yaw = yaw_from_quaternion(q)
        except MessageError:
            return
        roll, pitch, _ = rpy_from_xyzw((q.x, q.y, q.z, q.w))
        position = np.array([point.x, point.y, point.z])
        if not np.isfinite(position).all():
            return
        with self._lock:
            if self._values.position is not None:
                moved = np.hypot(*(position - self._values.position)[:2])
                self._values.distance += float(moved)
            self._values.position = position
            self._values.attitude = np.array([roll, pitch, yaw])
            self._values.speed = float(odometry.twist.twist.linear.x)

    def _on_cloud(self, cloud: PointCloud2) -> None:
        try:
            terrain = terrain_from_point_cloud(cloud)
        except (MessageError, RoverError) as error:
            self.get_logger().warning(f"elevation_cloud not shown: {error}")
            return
        with self._lock:
            self._terrain = terrain

    def _on_plan(self, plan: Path) -> None:
        try:
            poses = path_to_poses(plan, self._frame) if plan.poses else None
        except MessageError as error:
            self.get_logger().warning(f"plan not shown: {error}")
            return
        with self._lock:
            self._plan = poses

    def _on_verdict(self, verdict: DiagnosticArray) -> None:
        if verdict.status:
            status = verdict.status[0]
            passable = status.level != DiagnosticStatus.ERROR
            with self._lock:
                self._verdict = LiveVerdict(passable, "" if passable else status.message)

    def _on_contact_angles(self, message: Float64MultiArray) -> None:
        if len(message.data) >= 6:
            with self._lock:
                self._values.contact_angles = np.array(message.data[:6])

    def _on_prediction_of(self, field: str) -> Callable[[Float64MultiArray], None]:
        def take(message: Float64MultiArray) -> None:
            try:
                rows = array_values(message).copy()
            except MessageError as error:
                self.get_logger().warning(f"{field} not shown: {error}")
                return
            with self._lock:
                self._predicted[field] = rows

        return take

    def _on_estimate_of(self, field: str) -> Callable[[Float64MultiArray], None]:
        def take(message: Float64MultiArray) -> None:
            if len(message.data) == 6:
                with self._lock:
                    self._estimated.add(field)
                    setattr(self._values, field, np.array(message.data))
                    self._values.forces_from = "forces estimated by the traction controller"

        return take


class LiveLink:
    """A listener that is spun in the background until it is closed."""

    def __init__(self, map_frame: str = "map", context: Context | None = None):
        """Start to listen; without a context the link makes one, and shuts it down at its end."""
        self._owns_context = context is None
        self._context = context or Context()
        if self._owns_context:
            rclpy.init(context=self._context)
        self.listener = LiveListener(map_frame, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.listener)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._ended.set()
        self._executor.wake()
        self._thread.join(5.0)
        self._executor.shutdown()
        self.listener.destroy_node()
        if self._owns_context:
            self._context.try_shutdown()

    def _spin(self) -> None:
        # Not executor.spin(): at times that does not return from executor.shutdown().
        with contextlib.suppress(ExternalShutdownException):
            while not self._ended.is_set():
                self._executor.spin_once(timeout_sec=0.2)
