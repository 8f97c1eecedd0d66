# SPDX-License-Identifier: Apache-2.0
"""The node /rover_simulator: simulates a rover on a terrain with the topics of a real rover."""

import contextlib
import json
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import rclpy
import rclpy.logging
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Float64MultiArray

from msg_adapters.commands import joint_order, twist_to_speeds
from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.joints import convert_steering
from msg_adapters.paths import path_to_poses
from msg_adapters.sensing import BASE_FRAME, imu_message, joint_state, odometry_message
from rover_physics.names import WHEEL_JOINTS
from rover_planner.maps.summary import describe_terrain
from rover_planner.nodes.programs import read_words
from rover_planner.nodes.stop_signals import LOOK_FOR_STOP, StopSignals
from rover_planner.parameters.declare import declare_parameters
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.parameters.unknown import warn_of_unknown_parameters
from rover_planner.ros.disk import init_ros, warn_of_disk
from rover_planner.ros.qos import map_qos, sensor_qos, topic_qos
from rover_planner.ros.refusals import INPUT_ERRORS
from rover_planner.shell.exit_codes import EXIT_BAD_INPUT, EXIT_OK
from rover_planner.simulator.plant import PlantState
from rover_planner.simulator.simulation import Simulation, load_simulation_settings

NODE_NAME = "rover_simulator"
COMMANDS = "traction_controller/commands"
"""Topic of the torque commands; remap it for another controller."""
DEVIATIONS = (0.01, 0.005)
"""Standard deviations in odometry: positions [m] and angles [rad]."""
DIAGNOSTICS_PERIOD = 1.0
"""Time between two diagnostic messages [s]."""


class RoverSimulator(Node):
    """Connects a Simulation to ROS topics."""

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, **node_arguments)
        parameters = declare_parameters(self, RoverSimulatorParameters)
        self._frame, self._steering_sign = parameters.map_frame, parameters.steering_sign
        self._order = joint_order(parameters.joints)
        self._settings = load_simulation_settings(parameters)
        self._simulation = Simulation(self._settings)
        self._period = 1.0 / parameters.rate
        self._told = ""
        self._own_stamps: deque[tuple[int, int]] = deque(maxlen=64)
        self._create_publishers()
        self._create_subscriptions()
        self._state: PlantState = self._simulation.plant.state()
        self.create_timer(self._period, self._advance)
        self.create_timer(1.0 / parameters.map_rate, self._publish_map)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        self._publish_map()
        warn_of_unknown_parameters(self, RoverSimulatorParameters)
        self.get_logger().info(
            f"ready: rover {self._settings.rover.name} on {parameters.engine}, starts at "
            f"{', '.join(f'{value:.2f}' for value in self._settings.start)}, terrain "
            f"{parameters.terrain_file or 'made'}: {describe_terrain(self._settings.terrain)}"
        )

    @property
    def simulation(self) -> Simulation:
        """The rover."""
        return self._simulation

    def _create_publishers(self) -> None:
        qos = sensor_qos()
        self._joints = self.create_publisher(JointState, "joint_states", qos)
        self._odometry = self.create_publisher(Odometry, "odometry", qos)
        self._imu = self.create_publisher(Imu, "imu", qos)
        self._cloud = self.create_publisher(PointCloud2, "elevation_cloud", map_qos())
        self._diagnostics = self.create_publisher(DiagnosticArray, "diagnostics", topic_qos())
        self._commands = None
        if self._settings.parameters.follow_commands:
            self._commands = self.create_publisher(TwistStamped, "cmd_vel", qos)
        self._transforms = _make_broadcaster(self)

    def _create_subscriptions(self) -> None:
        qos = topic_qos()
        self.create_subscription(Path, "path", self._take_path, qos)
        self.create_subscription(TwistStamped, "cmd_vel", self._take_speeds, sensor_qos())
        if self._settings.parameters.follow_commands:
            self.create_subscription(Float64MultiArray, COMMANDS, self._take_torques, qos)

    def _take_path(self, path: Path) -> None:
        try:
            self._simulation.take_path(path_to_poses(path, self._frame))
        except MessageError as error:
            self.get_logger().error(f"path refused: {error}")

    def _take_speeds(self, twist: TwistStamped) -> None:
        if _stamp_of(twist) in self._own_stamps:
            return
        try:
            self._simulation.take_speeds(*twist_to_speeds(twist), time.monotonic())
        except MessageError as error:
            self.get_logger().error(f"cmd_vel refused: {error}", throttle_duration_sec=5.0)

    def _take_torques(self, message: Float64MultiArray) -> None:
        efforts = np.array(message.data)
        if efforts.shape != (6,) or not np.isfinite(efforts).all():
            self.get_logger().error(
                f"commands refused: {efforts.tolist()}; they must be 6 finite torques in N m",
                throttle_duration_sec=5.0,
            )
            return
        torques = np.empty(6)
        torques[self._order] = efforts
        self._simulation.take_torques(torques, time.monotonic())

    def _advance(self) -> None:
        self._state = state = self._simulation.advance(time.monotonic(), self._period)
        stamp = self.get_clock().now().to_msg()
        efforts = dict(zip(WHEEL_JOINTS, state.wheel_torques.tolist(), strict=True))
        positions, velocities = (
            convert_steering(values, self._steering_sign)
            for values in (state.joint_positions | self._arm_angles(), state.joint_velocities)
        )
        self._joints.publish(joint_state(positions, velocities, efforts, stamp))
        self._odometry.publish(
            odometry_message(
                state.position, state.orientation, state.velocity, state.body_rates,
                DEVIATIONS, self._frame, stamp,
            )
        )  # fmt: skip
        gravity = self._settings.rover.gravity
        self._imu.publish(
            imu_message(state.orientation, state.body_rates, gravity, DEVIATIONS[1], stamp)
        )
        if self._commands is not None and not self._simulation.has_speeds(time.monotonic()):
            twist = _twist(self._simulation.steering, stamp)
            self._own_stamps.append(_stamp_of(twist))
            self._commands.publish(twist)
        if self._transforms is not None:
            self._transforms.sendTransform(_transform(state, self._frame, stamp))
        self._tell(state)

    def _arm_angles(self) -> dict[str, float]:
        arm = self._settings.rover.manipulator
        return {} if arm is None else dict(zip(arm.joints, arm.stowed, strict=True))

    def _tell(self, state: PlantState) -> None:
        """Log once when the rover stops, with the reason, and once when it moves on."""
        if state.stopped == self._told:
            return
        self._told = state.stopped
        if state.stopped:
            self.get_logger().warning(f"stopped: {state.stopped}")
        else:
            self.get_logger().info("drives on")
        self._publish_diagnostics()

    def _publish_diagnostics(self) -> None:
        state, speeds = self._state, self._simulation.steering
        said = {
            "position": np.round(state.position, 3).tolist(),
            "wanted_speed": round(speeds[0], 4),
            "wanted_yaw_rate": round(speeds[1], 4),
            "follows_path": self._simulation.follows_path,
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.ERROR if state.stopped else DiagnosticStatus.OK,
            name=f"{NODE_NAME}: rover",
            message=state.stopped or "nothing stops the rover",
            hardware_id=self._settings.rover.name,
            values=[KeyValue(key=key, value=json.dumps(value)) for key, value in said.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _publish_map(self) -> None:
        stamp = self.get_clock().now().to_msg()
        self._cloud.publish(terrain_to_point_cloud(self._simulation.look(), self._frame, stamp))


def _twist(speeds: tuple[float, float], stamp: Any) -> TwistStamped:
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = stamp, BASE_FRAME
    message.twist.linear.x, message.twist.angular.z = speeds
    return message


def _stamp_of(twist: TwistStamped) -> tuple[int, int]:
    return twist.header.stamp.sec, twist.header.stamp.nanosec


def _transform(state: PlantState, frame_id: str, stamp: Any) -> TransformStamped:
    message = TransformStamped(child_frame_id=BASE_FRAME)
    message.header.stamp, message.header.frame_id = stamp, frame_id
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = state.position.tolist()
    turn.x, turn.y, turn.z, turn.w = state.orientation.tolist()
    return message


def _make_broadcaster(node: Node) -> Any:
    """Return a transform broadcaster, None without tf2, which PyPI does not offer."""
    with contextlib.suppress(ImportError):
        from tf2_ros import TransformBroadcaster

        return TransformBroadcaster(node)
    return None


def main(words: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped; return 2 for a wrong argument or parameter, else 0."""
    node, stop = None, StopSignals()
    try:
        options = read_words(NODE_NAME, words)
        if options == EXIT_OK:  # help was printed
            return EXIT_OK
        rclpy.logging.get_logger(NODE_NAME).info(
            "compiling kernels; the first start takes longest"
        )
        init_ros(words, signal_handler_options=SignalHandlerOptions.NO)
        overrides = [Parameter(name, value=value) for name, value in options.items()]
        node = RoverSimulator(parameter_overrides=overrides)
        executor = SingleThreadedExecutor()
        stop.defer(executor.wake)
        warn_of_disk(node.get_logger())
        executor.add_node(node)
        while not stop.wanted:
            executor.spin_once(timeout_sec=LOOK_FOR_STOP)
    except INPUT_ERRORS as error:
        rclpy.logging.get_logger(NODE_NAME).fatal(str(error))
        return EXIT_BAD_INPUT
    except (KeyboardInterrupt, ExternalShutdownException):
        return EXIT_OK
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
