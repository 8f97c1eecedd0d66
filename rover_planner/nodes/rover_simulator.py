# SPDX-License-Identifier: Apache-2.0
"""The node /rover_simulator: simulates a rover on a terrain with the topics of a real rover."""

import sys
import time
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Bool, Float64MultiArray, Header, String

from msg_adapters.commands import joint_order, twist_to_speeds
from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.identity import path_hash
from msg_adapters.joints import JointNames
from msg_adapters.paths import path_to_poses
from msg_adapters.results.diagnostics import SIMULATOR, make_status, texts_of
from msg_adapters.sensors import BASE_FRAME, imu_message, joint_state, odometry_message
from msg_adapters.stamps import NANOSECONDS, ns_to_stamp
from rover_physics.names import WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.rover_file import load_rover
from rover_planner.maps.known_map import describe_terrain
from rover_planner.nodes.running import run_node
from rover_planner.nodes.warm_up import SIMULATION, load_kernels
from rover_planner.parameters.rover_simulator import QUASI_STATIC, RoverSimulatorParameters
from rover_planner.parameters.shared import STOP
from rover_planner.ros.node import RoverNode, create_steady_timer
from rover_planner.ros.qos import LATCHED_QOS, SENSOR_QOS, TOPIC_QOS
from rover_planner.shell.extras import find_type
from rover_planner.simulator.plant import PlantState
from rover_planner.simulator.simulation import Simulation, load_ground

NODE_NAME = "rover_simulator"
COMMANDS, BRAKE = "traction_controller/commands", "traction_controller/brake"
"""Topics of the torque commands and the brake; remap them for another controller."""
STANDING_PERIOD = 0.1
"""Time between two commands of a rover that is to stand [s]."""
DEVIATIONS = (0.01, 0.005)
"""Standard deviations in odometry: positions [m] and angles [rad]."""
COVARIANCE = np.diag(np.repeat(np.square(DEVIATIONS), 3))
"""The same as (6, 6) of a pose: x, y, z, roll, pitch, yaw."""
SWITCH_INTERVAL = 5e-4
"""Longest time for which the thread that makes maps may delay a step whenever that needs Python's
lock [s]; Python's thread switch interval."""
DIAGNOSTICS_PERIOD = 1.0
"""Time between two diagnostic messages [s]."""


class RoverSimulator(RoverNode[RoverSimulatorParameters]):
    """Connects a Simulation to ROS topics.

    With use_sim_time it is the source of /clock: its time goes on by a period with each step, so
    that speeds and stamps agree however late its steps are.
    """

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, RoverSimulatorParameters, **node_arguments)
        parameters = self.values
        self._frame = parameters.map_frame
        self._joint_names = JointNames(steering=parameters.steering_sign)
        self._order = joint_order(parameters.joints)
        rover, terrain = load_rover(parameters.rover), load_ground(parameters)
        if parameters.engine == QUASI_STATIC:
            load_kernels(SIMULATION, (), self.get_logger().info)
        self.simulation = Simulation(rover, terrain, parameters)
        """The rover."""
        self._period = 1.0 / parameters.rate
        self._standing_steps = max(1, round(STANDING_PERIOD * parameters.rate))
        self._stopped, self._path_hash, self._steps = "", "", 0
        self._measured: tuple[Any, ...] = ()
        self._own_stamps: deque[tuple[int, int]] = deque(maxlen=64)
        self._create_publishers()
        self._create_subscriptions()
        self._state: PlantState = self.simulation.plant.state()
        self._start = time.time_ns()
        self.loop = create_steady_timer(self, self._period, self._advance)
        # A map takes longer than a step: other threads must not make the rover's sensors late.
        self._maps, self._map_in_work = ThreadPoolExecutor(1, "maps"), Future[None]()
        self._map_in_work.set_result(None)
        create_steady_timer(self, 1.0 / parameters.map_rate, self._begin_map)
        create_steady_timer(self, DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        self._begin_map()
        self.get_logger().info(
            f"ready: rover {rover.name} on {parameters.engine}, starts at "
            f"{parameters.start_x:.2f}, {parameters.start_y:.2f}, {parameters.start_yaw:.2f}, "
            f"terrain {parameters.terrain_file or 'made'}: {describe_terrain(terrain)}"
        )

    def _create_publishers(self) -> None:
        qos = QoSProfile(depth=5)  # reliable, so that every subscriber hears it
        kinds = {"joint_states": JointState, "odometry": Odometry, "imu": Imu}
        self._sensors = [self.create_publisher(kind, name, qos) for name, kind in kinds.items()]
        self._driven = self.create_publisher(String, "path_driven", LATCHED_QOS)
        self._cloud = self.create_publisher(PointCloud2, "elevation_cloud", LATCHED_QOS)
        self._diagnostics = self.create_publisher(DiagnosticArray, "diagnostics", TOPIC_QOS)
        self._clock_publisher = None
        if self.get_parameter("use_sim_time").value:
            self._clock_publisher = self.create_publisher(ClockMessage, "/clock", qos)
        self._commands = None
        if self.values.follow_commands:
            self._commands = self.create_publisher(TwistStamped, "cmd_vel", qos)
        broadcaster: Any = find_type("tf2_ros:TransformBroadcaster")
        self._transforms = None if broadcaster is None else broadcaster(self)

    def _create_subscriptions(self) -> None:
        qos, hear, rover = TOPIC_QOS, self.heard.subscribe, self.simulation
        hear(Bool, STOP, lambda one, arrival: rover.take_stop(one.data, arrival), qos)
        hear(Path, "path", self._take_path, qos)
        hear(TwistStamped, "cmd_vel", self._take_speeds, SENSOR_QOS)
        if self.values.follow_commands:
            hear(Float64MultiArray, COMMANDS, self._take_torques, SENSOR_QOS)
            hear(Bool, BRAKE, lambda one, _: rover.take_brake(one.data), LATCHED_QOS)

    def _take_path(self, path: Path, _arrival: float) -> None:
        self.simulation.take_path(path_to_poses(path, self._frame))
        self._path_hash = path_hash(path)

    def _take_speeds(self, twist: Any, arrival: float) -> None:
        if _stamp_of(twist) not in self._own_stamps:
            self.simulation.take_speeds(*twist_to_speeds(twist), arrival)

    def _take_torques(self, message: Float64MultiArray, arrival: float) -> None:
        efforts = np.array(message.data)
        if efforts.shape != (6,) or not np.isfinite(efforts).all():
            raise MessageError(
                f"they are {efforts.tolist()}; they must be 6 finite torques in N m"
            )
        torques = np.empty(6)
        torques[self._order] = efforts
        self.simulation.take_torques(torques, arrival)

    def _advance(self) -> None:
        self.heard.poll()
        before, self._state = self._state, self.simulation.advance(time.monotonic(), self._period)
        self._steps += 1
        state, stamp = self._state, self._stamp
        if self._clock_publisher is not None:
            self._clock_publisher.publish(ClockMessage(clock=stamp))
        if state is not before or not self._measured:
            self._measured = self._write_sensors(state, stamp)
        for publisher, message in zip(self._sensors, self._measured, strict=True):
            message.header.stamp = stamp
            publisher.publish(message)
        is_due = any(self.simulation.steering) or self._steps % self._standing_steps == 0
        own = not self.simulation.has_speeds(time.monotonic())
        if self._commands is not None and is_due and own:
            twist = _twist(self.simulation.steering, stamp)
            self._own_stamps.append(_stamp_of(twist))
            self._commands.publish(twist)
        if self._transforms is not None:
            self._transforms.sendTransform(_transform(state, self._frame, stamp))
        self._log_stop(state)
        if self._path_hash and self.simulation.at_end:
            self._driven.publish(String(data=self._path_hash))
            self._path_hash = ""

    def _write_sensors(self, state: PlantState, stamp: Any) -> tuple[JointState, Odometry, Imu]:
        """Return what the sensors measure."""
        efforts = dict(zip(WHEEL_JOINTS, state.wheel_torques.tolist(), strict=True))
        positions, velocities = (
            self._joint_names.turn(values)
            for values in (state.joint_positions | self._arm_angles(), state.joint_velocities)
        )
        odometry = odometry_message(
            state.position, state.orientation, state.velocity, state.body_rates,
            (COVARIANCE, COVARIANCE), self._frame, stamp,
        )  # fmt: skip
        gravity = self.simulation.rover.gravity
        imu = imu_message(state.orientation, state.body_rates, gravity, DEVIATIONS[1], stamp)
        return joint_state(positions, velocities, efforts, stamp), odometry, imu

    @property
    def _stamp(self) -> Any:
        """Time now: that of the simulation if it is the source of /clock."""
        if self._clock_publisher is None:
            return self.get_clock().now().to_msg()
        return ns_to_stamp(self._start + round(self._steps * self._period * NANOSECONDS))

    def _arm_angles(self) -> dict[str, float]:
        arm = self.simulation.rover.manipulator
        return {} if arm is None else dict(zip(arm.joints, arm.stowed, strict=True))

    def _log_stop(self, state: PlantState) -> None:
        """Log once when the rover stops, with the reason, and once when it moves on."""
        if state.stopped == self._stopped:
            return
        self._stopped = state.stopped
        if state.stopped:
            self.get_logger().warning(f"stopped: {state.stopped}")
        else:
            self.get_logger().info("drives on")
        self._publish_diagnostics()

    def _publish_diagnostics(self) -> None:
        state, speeds = self._state, self.simulation.steering
        values = {
            "position": np.round(state.position, 3).tolist(),
            "wanted_speed": round(speeds[0], 4),
            "wanted_yaw_rate": round(speeds[1], 4),
            "follows_path": self.simulation.follows_path,
        }
        level, text = (
            ("error", state.stopped) if state.stopped else ("ok", "nothing stops the rover")
        )
        name = self.simulation.rover.name
        status = make_status(SIMULATOR, level, text, texts_of(values), name)
        header = Header(stamp=self._stamp)
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))

    def destroy_node(self) -> None:
        """Finish the map in work, and destroy the node."""
        self._maps.shutdown()
        super().destroy_node()

    def _begin_map(self) -> None:
        """Have a map of what is seen now made in the thread, unless one is still in work."""
        if self._map_in_work.done():
            here = self._state.position, float(self.simulation.plant.pose()[2])
            stamp = self._stamp
            make = partial(self._publish_map, *here, stamp)
            self._map_in_work = self._maps.submit(self.guard.call, make)

    def _publish_map(self, position: Floats, yaw: float, stamp: Any) -> None:
        seen = self.simulation.look(position, yaw)
        self._cloud.publish(terrain_to_point_cloud(seen, self._frame, stamp))


def _twist(speeds: tuple[float, float], stamp: Any) -> TwistStamped:
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = stamp, BASE_FRAME
    message.twist.linear.x, message.twist.angular.z = speeds
    return message


def _stamp_of(twist: Any) -> tuple[int, int]:
    return twist.header.stamp.sec, twist.header.stamp.nanosec


def _transform(state: PlantState, frame_id: str, stamp: Any) -> TransformStamped:
    message = TransformStamped(child_frame_id=BASE_FRAME)
    message.header.stamp, message.header.frame_id = stamp, frame_id
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = state.position.tolist()
    turn.x, turn.y, turn.z, turn.w = state.orientation.tolist()
    return message


main = partial(run_node, NODE_NAME, RoverSimulator, SWITCH_INTERVAL)
"""Runs the node until it is stopped; returns 2 for a wrong argument or parameter, else 0."""


if __name__ == "__main__":
    sys.exit(main())
