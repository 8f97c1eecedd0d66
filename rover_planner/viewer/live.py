"""A node that listens to a rover and its planner, and keeps the latest for the page."""

import math
import threading
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64MultiArray

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.paths import path_to_poses, yaw_from_quaternion
from msg_adapters.predictions import array_values
from rover_physics.errors import RoverError
from rover_physics.names import WHEEL_JOINTS
from rover_physics.terrain import Terrain
from rover_planner.qos import map_subscriptions_qos, result_qos, sensor_qos, topic_qos
from rover_planner.viewer.live_frame import LiveState

SERVER, CONTROLLER = "/traverse_server", "/traction_controller"
PER_WAYPOINT = {"wheel_loads": "wheel_loads", "friction_utilisation": "friction_utilisation",
                "slip_ratios": "slip_ratio"}  # fmt: skip
"""Topics of the server with a row per waypoint, and the field each fills."""
MEASURED = {"wheel_loads": "wheel_loads", "friction_utilisation": "friction_utilisation"}
"""Topics of the controller, which count more than what was predicted."""


class LiveListener(Node):
    """Keeps the latest state, map, plan and verdict; bad messages are passed over with a word."""

    def __init__(self, map_frame: str = "map", **node_arguments: Any):
        """Subscribe to the topics of a rover, a traverse_server and a traction_controller."""
        super().__init__("rover_view", **node_arguments)
        self._frame = map_frame
        self._lock = threading.Lock()
        self._state = LiveState()
        self._predicted: dict[str, np.ndarray] = {}
        self._terrain: Terrain | None = None
        self._plan: np.ndarray | None = None
        self._verdict = ""
        self._measured: set[str] = set()
        self._first_time: float | None = None
        sensors = sensor_qos()
        self.create_subscription(JointState, "joint_states", self._take_joints, sensors)
        self.create_subscription(Odometry, "odometry", self._take_odometry, sensors)
        for qos in map_subscriptions_qos("either"):
            self.create_subscription(PointCloud2, "elevation_cloud", self._take_cloud, qos)
        self.create_subscription(Path, f"{SERVER}/plan", self._take_plan, result_qos())
        self.create_subscription(
            DiagnosticArray, f"{SERVER}/verdict", self._take_verdict, result_qos()
        )
        for topic, field in {**PER_WAYPOINT, "tip_over_margin": "tip_over_ratio"}.items():
            self.create_subscription(
                Float64MultiArray, f"{SERVER}/{topic}", self._predictor(field), result_qos()
            )
        for topic, field in MEASURED.items():
            self.create_subscription(
                Float64MultiArray, f"{CONTROLLER}/{topic}", self._measurer(field), topic_qos()
            )
        self.create_subscription(
            Float64MultiArray, f"{CONTROLLER}/contact_angles", self._take_angles, topic_qos()
        )

    def latest(self) -> tuple[LiveState, Terrain | None, np.ndarray | None, str]:
        """Return state, map, plan (n, 3) and verdict; None or "" for what did not come."""
        with self._lock:
            self._fill_from_prediction()
            return self._state, self._terrain, self._plan, self._verdict

    def _fill_from_prediction(self) -> None:
        """Take from the plan what nothing measures, at the waypoint nearest to the rover."""
        if self._plan is None or self._state.position is None or not len(self._plan):
            return
        away = np.hypot(*(self._plan[:, :2] - self._state.position[:2]).T)
        share = int(np.argmin(away)) / max(len(away) - 1, 1)
        for field, rows in self._predicted.items():
            if field in self._measured or not len(rows):
                continue
            row = np.nan_to_num(rows[round(share * (len(rows) - 1))])
            setattr(self._state, field, float(row[0]) if field == "tip_over_ratio" else row)

    def _take_joints(self, state: JointState) -> None:
        with self._lock:
            for values, into in (
                (state.position, self._state.joints),
                (state.effort, self._state.efforts),
            ):
                if len(values) == len(state.name):
                    pairs = zip(state.name, values, strict=True)
                    into.update({name: value for name, value in pairs if math.isfinite(value)})
            if len(state.velocity) == len(state.name):
                self._add_work(dict(zip(state.name, state.velocity, strict=True)), state)

    def _add_work(self, rates: dict[str, float], state: JointState) -> None:
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        self._first_time = now if self._first_time is None else self._first_time
        passed = now - self._first_time - self._state.time
        if passed > 0.0:
            power = sum(
                max(self._state.efforts.get(name, 0.0) * rates.get(name, 0.0), 0.0)
                for name in WHEEL_JOINTS
            )
            self._state.energy += power * passed
            self._state.time += passed

    def _take_odometry(self, odometry: Odometry) -> None:
        place, q = odometry.pose.pose.position, odometry.pose.pose.orientation
        try:
            yaw = yaw_from_quaternion(q)
        except MessageError:
            return
        roll = math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2))
        pitch = math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x))))
        position = np.array([place.x, place.y, place.z])
        if not np.isfinite(position).all():
            return
        with self._lock:
            if self._state.position is not None:
                moved = np.hypot(*(position - self._state.position)[:2])
                self._state.distance += float(moved)
            self._state.position = position
            self._state.attitude = np.array([roll, pitch, yaw])
            self._state.speed = float(odometry.twist.twist.linear.x)

    def _take_cloud(self, cloud: PointCloud2) -> None:
        try:
            terrain = terrain_from_point_cloud(cloud)
        except (MessageError, RoverError) as error:
            self.get_logger().warning(f"elevation_cloud not shown: {error}")
            return
        with self._lock:
            self._terrain = terrain

    def _take_plan(self, plan: Path) -> None:
        try:
            poses = path_to_poses(plan, self._frame) if plan.poses else None
        except MessageError as error:
            self.get_logger().warning(f"plan not shown: {error}")
            return
        with self._lock:
            self._plan = poses

    def _take_verdict(self, verdict: DiagnosticArray) -> None:
        with self._lock:
            self._verdict = verdict.status[0].message if verdict.status else ""

    def _take_angles(self, message: Float64MultiArray) -> None:
        if len(message.data) >= 6:
            with self._lock:
                self._state.contact_angles = np.array(message.data[:6])

    def _predictor(self, field: str) -> Any:
        def take(message: Float64MultiArray) -> None:
            try:
                rows = array_values(message).copy()
            except MessageError as error:
                self.get_logger().warning(f"{field} not shown: {error}")
                return
            with self._lock:
                self._predicted[field] = rows

        return take

    def _measurer(self, field: str) -> Any:
        def take(message: Float64MultiArray) -> None:
            if len(message.data) == 6:
                with self._lock:
                    self._measured.add(field)
                    setattr(self._state, field, np.nan_to_num(np.array(message.data)))

        return take


def following(page: Any, context: Context | None = None) -> LiveListener:
    """Let a page follow a live graph, by a node that is spun in the background."""
    context = context or rclpy.get_default_context()
    if not context.ok():
        rclpy.init(context=context)
    listener = LiveListener(context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(listener)

    def spin() -> None:
        try:
            while context.ok():
                executor.spin_once(timeout_sec=0.2)
        except ExternalShutdownException:
            return

    threading.Thread(target=spin, daemon=True).start()
    page.follow(listener)
    return listener
