"""Makes hostile messages: plausible ones with numbers, names and lengths that nobody expects."""

import array
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, TwistStamped, Wrench, WrenchStamped
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan, LoadMap
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import Imu, JointState, PointCloud2, PointField

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import poses_path, stamped_pose
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.terrain.grid import Terrain

NUMBERS = (
    0.0, -0.0, 5e-324, 1e-310, 1e-154, 1e-9, 1e-7, 1e-3, 0.1, 1.0, -1.0, 3.15, 1e3, 1e6, 4.6e6,
    -1e9, 1.1e9, 1e19, 1e30, 3.4e38, 1e154, 1e155, -1e200, 1e300, 1.79e308, math.inf, -math.inf,
    math.nan,
)  # fmt: skip
WHOLE = (0, 1, 2, 3, 7, 255, 65_536, 2**31 - 1, 2**31, 2**32 - 1)
NAMES = ("", "map", "odom", "x", "z", "friction", "rocker_left", "\n", "\x1b[2J", "é", "n" * 300,
         "n" * 100_000)  # fmt: skip
URLS = (
    "", "//[", "http://[bad", "file://", "file:///", "file://[::1", "/dev/zero", "/dev/random",
    "/proc/self/mem", "/etc/passwd", "spirit", "u" * 300, "u" * 5_000, "../" * 50, "%00", "a%00b",
    "file:///%ff%fe", "\n", "é.npz", "~", "file:////dev/tty", "/proc/self/fd/0",
)  # fmt: skip
SERVER_PARAMETERS = (
    "rover", "friction", "max_torque", "soil", "payload", "policy", "candidate_count",
    "candidate_spacing", "waypoint_spacing", "plan_spacing", "map_frame", "map_resolution",
    "cell_height", "unknown_cells", "max_gap", "map_sigmas", "terrain_file",
    "suspension_tolerance", "use_sim_time", "no_such_parameter", "",
)  # fmt: skip
EDGE = 1.5
"""Place x of the edge of the ground that hostile paths lead over [m]."""
ARM_JOINTS = ("arm_yaw", "arm_shoulder", "arm_elbow")


class HostileMaker:
    """Makes hostile messages, the same ones for the same seed."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)
        self._kinds: dict[str, Callable[[], Any]] = {
            "cloud": self.cloud,
            "path": self.path,
            "plan": self.plan_request,
            "joint_states": self.joint_state,
            "imu": self.imu,
            "odometry": self.odometry,
            "cmd_vel": self.twist,
            "tool_target": self.tool_target,
            "tool_wrench": self.tool_wrench,
        }

    @np.errstate(all="ignore")
    def make(self, kind: str) -> Any:
        """Return a message of a kind; the kinds are the methods below."""
        return self._kinds[kind]()

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of messages."""
        return tuple(self._kinds)

    def number(self) -> float:
        """Return a hostile number."""
        return float(self.rng.choice(NUMBERS)) * float(self.rng.choice((1.0, 1.0, 0.7)))

    def name(self) -> str:
        """Return a hostile name."""
        return self._pick(NAMES)

    def cloud(self) -> PointCloud2:
        """Return a plausible cloud, raster or scattered, with none to three faults."""
        cloud = self._plausible_cloud()
        faults = (
            self._hurt_points, self._hurt_points, self._scale_points, self._hurt_field,
            self._hurt_sizes, self._hurt_data, self._hurt_frame,
        )  # fmt: skip
        for _ in range(self._pick((0, 0, 1, 1, 2, 3))):
            self._pick(faults)(cloud)
        return cloud

    def path(self) -> Path:
        """Return a path with hostile poses, spacings, frames or lengths."""
        n = int(self.rng.choice((0, 1, 2, 3, 20, 100, 1000)))
        step = float(self.rng.choice((0.0, 1e-300, 1e-9, 1e-6, 1e-3, 0.02, 0.1, 1.0, 1e5)))
        start = self.rng.uniform(-2.0, 2.0, 3)
        poses = start + np.outer(np.arange(n), [step, 0.0, 0.0])
        if n and self.rng.random() < 0.2:
            poses[:, 1:] = 0.0
            poses = np.vstack([poses, [EDGE + 0.3, 0.0, 0.0]])
        path = poses_path(poses, self._frame())
        for _ in range(self.rng.integers(0, 3)):
            if path.poses:
                stamped = path.poses[self.rng.integers(len(path.poses))]
                self._hurt_pose(stamped.pose)
        if path.poses and self.rng.random() < 0.05:
            path.poses[-1].header.frame_id = self.name()
        return path

    def plan_request(self) -> GetPlan.Request:
        """Return a request for a plan with hostile poses and tolerance."""
        start, goal = (stamped_pose(self.rng.uniform(-2.0, 2.0, 3), self._frame()) for _ in "ab")
        for stamped in (start, goal):
            if self.rng.random() < 0.4:
                self._hurt_pose(stamped.pose)
        tolerance = float(np.clip(self.number(), -3e38, 3e38)) if self.rng.random() < 0.5 else 0.0
        return GetPlan.Request(start=start, goal=goal, tolerance=tolerance)

    def map_request(self) -> LoadMap.Request:
        """Return a request to load a map from a hostile place."""
        return LoadMap.Request(map_url=self._pick(URLS))

    def parameter_request(self) -> SetParameters.Request:
        """Return a request to set parameters of the server to hostile values."""
        return SetParameters.Request(
            parameters=[
                Parameter(name=self._pick(SERVER_PARAMETERS), value=self._parameter_value())
                for _ in range(self.rng.integers(0, 3))
            ]
        )

    def joint_state(self) -> JointState:
        """Return joint states with hostile names, numbers and lengths."""
        names = [*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS, *ARM_JOINTS]
        names = names if self.rng.random() < 0.7 else list(ARM_JOINTS)
        if self.rng.random() < 0.3:
            names[self.rng.integers(len(names))] = self.name()
        state = JointState(name=names)
        for field in ("position", "velocity", "effort"):
            values = array.array("d", self.rng.normal(0.0, 0.1, len(names)).tolist())
            if self.rng.random() < 0.4:
                values[int(self.rng.integers(len(values)))] = self.number()
            if self.rng.random() < 0.1:
                values = values[: int(self.rng.integers(len(values)))]
            setattr(state, field, values)
        state.header.frame_id = self._frame()
        self._hurt_stamp(state)
        return state

    def imu(self) -> Imu:
        """Return IMU data with hostile numbers."""
        imu = Imu()
        imu.header.frame_id = self._pick(("base_link", "base_link", self.name()))
        imu.orientation.w = 1.0
        self._hurt_numbers(imu.orientation, "xyzw", 0.4)
        self._hurt_numbers(imu.angular_velocity, "xyz", 0.4)
        self._hurt_numbers(imu.linear_acceleration, "xyz", 0.4)
        if self.rng.random() < 0.3:
            imu.orientation_covariance[0] = self.number()
            imu.angular_velocity_covariance[0] = self.number()
        self._hurt_stamp(imu)
        return imu

    def odometry(self) -> Odometry:
        """Return odometry with hostile numbers."""
        odometry = Odometry(child_frame_id=self._pick(("base_link", "base_link", self.name())))
        odometry.header.frame_id = self._frame()
        odometry.pose.pose.orientation.w = 1.0
        self._hurt_numbers(odometry.pose.pose.position, "xyz", 0.4)
        self._hurt_numbers(odometry.pose.pose.orientation, "xyzw", 0.4)
        if self.rng.random() < 0.3:
            odometry.pose.covariance[int(self.rng.choice((0, 7)))] = self.number()
        self._hurt_stamp(odometry)
        return odometry

    def twist(self) -> TwistStamped:
        """Return a commanded speed with hostile numbers."""
        twist = TwistStamped()
        twist.twist.linear.x = 0.02
        self._hurt_numbers(twist.twist.linear, "xyz", 0.5)
        self._hurt_numbers(twist.twist.angular, "xyz", 0.5)
        self._hurt_stamp(twist)
        return twist

    def tool_target(self) -> PoseStamped:
        """Return a target of the arm with hostile numbers."""
        target = stamped_pose((0.5, 0.0, 0.0), self._frame())
        self._hurt_pose(target.pose)
        return target

    def tool_wrench(self) -> WrenchStamped:
        """Return a wrench on the tool with hostile numbers."""
        stamped = WrenchStamped(wrench=Wrench())
        stamped.header.frame_id = self._frame()
        self._hurt_numbers(stamped.wrench.force, "xyz", 0.5)
        self._hurt_numbers(stamped.wrench.torque, "xyz", 0.5)
        return stamped

    def damaged(self, data: bytes) -> bytes:
        """Return serialised bytes with some of them changed, cut off or added."""
        how = self.rng.integers(4)
        if how == 0:
            return data[: self.rng.integers(len(data) + 1)]
        if how == 1:
            return data + self.rng.bytes(int(self.rng.integers(1, 64)))
        if how == 2:
            return data[:4] + self.rng.bytes(max(len(data) - 4, 1))
        changed = bytearray(data)
        for at in self.rng.integers(0, len(data), self.rng.integers(1, 9)):
            changed[at] = int(self.rng.integers(256))
        return bytes(changed)

    def _pick(self, choices: Any) -> Any:
        return choices[self.rng.integers(len(choices))]

    def _frame(self) -> str:
        return self.name() if self.rng.random() < 0.05 else "map"

    def _hurt_numbers(self, part: Any, names: str, share: float) -> None:
        if self.rng.random() < share:
            setattr(part, self._pick(names), self.number())

    def _hurt_pose(self, pose: Pose) -> None:
        self._hurt_numbers(pose.position, "xyz", 0.7)
        self._hurt_numbers(pose.orientation, "xyzw", 0.4)

    def _hurt_stamp(self, message: Any) -> None:
        if self.rng.random() < 0.1:
            message.header.stamp.sec = int(self.rng.choice((-(2**31), -1, 0, 2**31 - 1)))
            message.header.stamp.nanosec = int(self.rng.choice((0, 10**9, 2**32 - 1)))

    def _parameter_value(self) -> ParameterValue:
        kind = int(self.rng.integers(0, 10))
        value = ParameterValue(type=kind)
        value.bool_value = bool(self.rng.integers(2))
        value.integer_value = int(self.rng.choice((-(2**63), -1, 0, 1, 5, 2**31, 2**63 - 1)))
        value.double_value = self.number()
        value.string_value = self._pick((*NAMES, *URLS, "optimal", "mean", "interpolate"))
        value.double_array_value = [self.number()]
        value.string_array_value = [self.name()]
        value.byte_array_value = [b"\xff"]
        return value

    def _plausible_cloud(self) -> PointCloud2:
        resolution = float(self.rng.choice((1e-7, 1e-3, 0.05, 0.05, 0.05, 0.1, 1.0)))
        rows, columns = (int(k) for k in self.rng.integers(1, 40, 2))
        place = self.rng.choice((0.0, -1.0, 4.6e6))
        layers = {
            name: self.rng.uniform(0.01, 1.0, (rows + 1, columns + 1))
            for name in ("friction", "elevation_std") if self.rng.random() < 0.3
        }  # fmt: skip
        heights = self.rng.normal(0.0, 0.02, (rows + 1, columns + 1))
        heights[self.rng.random(heights.shape) < 0.05] = np.nan
        heights[0, 0] = 0.0
        terrain = Terrain(heights, 0.05, (place, place), **layers)
        datatype = self._pick((PointField.FLOAT32, PointField.FLOAT64))
        cloud = terrain_to_point_cloud(terrain, "map", datatype=datatype)
        values = _numbers_of(cloud)
        if self.rng.random() < 0.3:
            values = self.rng.permutation(values)
        if self.rng.random() < 0.3:
            values[:, :2] += self.rng.normal(0.0, resolution, (len(values), 2))
        if resolution != 0.05:
            values[:, :2] *= resolution / 0.05
        _set_numbers(cloud, values)
        return cloud

    def _hurt_points(self, cloud: PointCloud2) -> None:
        values = _numbers_of(cloud)
        if not len(values):
            return
        rows = self.rng.integers(0, len(values), int(self.rng.choice((1, 3, len(values)))))
        values[rows, int(self.rng.integers(values.shape[1]))] = self.number()
        _set_numbers(cloud, values)

    def _scale_points(self, cloud: PointCloud2) -> None:
        values = _numbers_of(cloud)
        values[:, int(self.rng.integers(values.shape[1]))] *= self.number()
        _set_numbers(cloud, values)

    def _hurt_field(self, cloud: PointCloud2) -> None:
        if not cloud.fields:
            return
        field = self._pick(cloud.fields)
        how = self.rng.integers(5)
        if how == 0:
            field.name = self.name()
        elif how == 1:
            field.datatype = int(self.rng.integers(0, 12))
        elif how == 2:
            field.offset = int(self.rng.choice(WHOLE))
        elif how == 3:
            field.count = int(self.rng.choice(WHOLE))
        else:
            cloud.fields = [*cloud.fields, field]

    def _hurt_sizes(self, cloud: PointCloud2) -> None:
        name = self._pick(("height", "width", "point_step", "row_step"))
        setattr(cloud, name, int(self.rng.choice(WHOLE)))

    def _hurt_data(self, cloud: PointCloud2) -> None:
        if self.rng.random() < 0.3:
            cloud.is_bigendian = not cloud.is_bigendian
        elif self.rng.random() < 0.5:
            cloud.data = cloud.data[: int(self.rng.integers(len(cloud.data) + 1))]
        else:
            cloud.data = array.array("B", self.rng.bytes(len(cloud.data)))

    def _hurt_frame(self, cloud: PointCloud2) -> None:
        cloud.header.frame_id = self.name()


def _numbers_of(cloud: PointCloud2) -> np.ndarray:
    """Return the numbers (points, fields) of a cloud, none if an earlier fault hides them."""
    kind = "<f8" if cloud.fields and cloud.fields[0].datatype == PointField.FLOAT64 else "<f4"
    values = np.frombuffer(cloud.data.tobytes(), np.uint8)
    values = values[: len(values) // 8 * 8].view(kind)
    fields = max(len(cloud.fields), 1)
    return values[: len(values) // fields * fields].reshape(-1, fields).copy()


def _set_numbers(cloud: PointCloud2, values: np.ndarray) -> None:
    """Write numbers (points, fields) over the start of a cloud's data."""
    data = values.tobytes()
    cloud.data[: len(data)] = array.array("B", data)
