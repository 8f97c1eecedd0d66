"""A node that listens to a rover and its planner, and keeps the latest for the page."""

import contextlib
import math
import threading
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
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64MultiArray

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.paths import path_to_poses, stamped_pose, yaw_from_quaternion
from msg_adapters.predictions import array_values
from rover_physics.errors import RoverError
from rover_physics.names import WHEEL_JOINTS
from rover_physics.numerics.quaternions import rpy_from_xyzw
from rover_physics.terrain.grid import Terrain
from rover_planner.ros.qos import map_subscriptions_qos, result_qos, sensor_qos, topic_qos
from rover_planner.viewer.live.live_frame import LiveState

SERVER, CONTROLLER = "/traverse_server", "/traction_controller"
PER_WAYPOINT = {"wheel_loads": "wheel_loads", "friction_utilisation": "friction_utilisation",
                "slip_ratios": "slip_ratio"}  # fmt: skip
"""Topics of the server with a row per waypoint, and the field each fills."""
MEASURED = {"wheel_loads": "wheel_loads", "friction_utilisation": "friction_utilisation"}
"""Topics of the controller, which count more than what was predicted."""


@dataclass(frozen=True)
class LiveVerdict:
    """What the server said last."""

    traversable: bool
    """Whether there is a path that the rover can drive."""
    reason: str
    """Why not, empty where there is one."""


@dataclass(frozen=True, eq=False)
class Heard:
    """What was heard last; None for what did not come."""

    state: LiveState
    """The rover."""
    terrain: Terrain | None
    """The map."""
    plan: np.ndarray | None
    """(n, 3) poses of the plan, x, y [m], yaw [rad]."""
    verdict: LiveVerdict | None
    """The verdict on what the server was asked for."""


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
        self._verdict: LiveVerdict | None = None
        self._measured: set[str] = set()
        self._first_time: float | None = None
        self._planner = self.create_client(GetPlan, f"{SERVER}/can_traverse")
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

    def latest(self) -> Heard:
        """Return what was heard last."""
        with self._lock:
            self._fill_from_prediction()
            return Heard(self._state.copy(), self._terrain, self._plan, self._verdict)

    def ask_for(self, place: np.ndarray) -> str:
        """Ask the server for a plan from where the rover is to a place (2,) [m].

        Returns:
            Why it can't be asked, empty if it was; plan and verdict come on their topics.
        """
        with self._lock:
            state = self._state.copy()
        if state.position is None:
            return "no odometry yet, so it is not known where to start"
        if not self._planner.service_is_ready():
            return f"no {SERVER}/can_traverse to ask"
        yaw = float(np.arctan2(*(np.asarray(place) - state.position[:2])[::-1]))
        start = (*state.position[:2], state.attitude[2])
        request = GetPlan.Request(
            start=stamped_pose(start, self._frame), goal=stamped_pose((*place, yaw), self._frame)
        )
        self._planner.call_async(request)
        return ""

    def _fill_from_prediction(self) -> None:
        """Take from the plan what nothing measures, at the waypoint nearest to the rover."""
        state = self._state
        if self._plan is None or state.position is None:
            return
        away = np.hypot(*(self._plan[:, :2] - state.position[:2]).T)
        share = int(np.argmin(away)) / max(len(away) - 1, 1)
        for field, rows in self._predicted.items():
            if field in self._measured or not len(rows):
                continue
            row = rows[round(share * (len(rows) - 1))]
            setattr(state, field, float(row[0]) if field == "tip_over_ratio" else row)
            state.forces_from = state.forces_from or "forces as the server predicted them"

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
        roll, pitch, _ = rpy_from_xyzw((q.x, q.y, q.z, q.w))
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
        if verdict.status:
            status = verdict.status[0]
            passable = status.level != DiagnosticStatus.ERROR
            with self._lock:
                self._verdict = LiveVerdict(passable, "" if passable else status.message)

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
                    setattr(self._state, field, np.array(message.data))
                    self._state.forces_from = "forces as the traction controller estimates them"

        return take


class LiveLink:
    """A listener that is spun in the background until it is closed."""

    def __init__(self, map_frame: str = "map", context: Context | None = None):
        """Start to listen; without a context one of its own is made, and ended with it."""
        self._own = context is None
        self._context = context or Context()
        if self._own:
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
        if self._own:
            self._context.try_shutdown()

    def _spin(self) -> None:
        # Not executor.spin(): now and then that sleeps through executor.shutdown().
        with contextlib.suppress(ExternalShutdownException):
            while not self._ended.is_set():
                self._executor.spin_once(timeout_sec=0.2)
