"""The node /traction_controller: commands wheel torques by a QP at a fixed rate."""

import gc
import signal
import sys
import time
from collections.abc import Sequence
from types import FrameType
from typing import Any

import numpy as np
import rclpy
import rclpy.logging
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Float64MultiArray

from msg_adapters.commands import (
    effort_commands,
    joint_order,
    set_values,
    twist_to_speeds,
    wheel_values,
)
from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from msg_adapters.imu import imu_to_attitude
from msg_adapters.joints import joint_positions, joint_velocities
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.results.traction_status import traction_diagnostics
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.terrain.grid import Terrain
from rover_planner.nodes.programs import read_words
from rover_planner.parameters.declare import declare_parameters, follow_changes
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.unknown import warn_of_unknown_parameters
from rover_planner.ros.disk import init_ros, warn_of_disk
from rover_planner.ros.map_intake import MapIntake
from rover_planner.ros.qos import map_subscriptions_qos, sensor_qos, topic_qos
from rover_planner.ros.realtime import take_priority
from rover_planner.ros.refusals import INPUT_ERRORS
from rover_planner.shell.exit_codes import EXIT_BAD_INPUT, EXIT_OK
from rover_planner.traction.prepared_map import PreparedMap, prepare_map
from rover_planner.traction.statistics import TractionStatistics
from rover_planner.traction.traction_service import (
    TractionService,
    TractionUpdate,
    load_traction_settings,
)

NODE_NAME = "traction_controller"
JOINTS = (*SUSPENSION_JOINTS, *WHEEL_JOINTS)
DIAGNOSTICS_PERIOD = 1.0
"""Time between two diagnostic messages [s]."""
SWITCH_INTERVAL = 2e-4
"""Longest time for which the thread that prepares maps may delay an update [s]; Python's
thread switch interval."""
ARRIVAL_TIME = Duration(seconds=0.2)
"""Longest wait for the final zero torques to reach their subscribers."""


class TractionController(Node):
    """Connects a TractionService to ROS; any fault sets the wheel torques to zero in time."""

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, **node_arguments)
        self._values = declare_parameters(self, TractionControllerParameters)
        self._order = joint_order(self._values.joints)
        self._service = TractionService(load_traction_settings(self._values))
        self._warm_up()
        self._statistics = TractionStatistics(1.0 / self._values.rate)
        self._fault, self._warning = "", ""
        self._create_publishers()
        self._maps = MapIntake(self._prepare_map, self._refuse_map)
        self._create_subscriptions()
        follow_changes(self, lambda: self._values, load_traction_settings, self._apply_parameters)
        self._timer = self.create_timer(1.0 / self._values.rate, self.update)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        warn_of_unknown_parameters(self, TractionControllerParameters)
        self.get_logger().info(f"ready for rover {self._service.settings.rover.name}")

    @property
    def service(self) -> TractionService:
        """The service that takes measurements and returns torques."""
        return self._service

    @property
    def statistics(self) -> TractionStatistics:
        """Update times, counts and the last update."""
        return self._statistics

    def take_priority(self) -> None:
        """Set the real-time priority of the parameter; log a warning if it is not granted."""
        refusal = take_priority(self._values.realtime_priority)
        if refusal:
            self.get_logger().warning(refusal)

    def stop(self) -> None:
        """Send zero torques, wait until they have arrived, and stop updating."""
        self._timer.cancel()
        self._send(self._commands, self._efforts, np.zeros(len(WHEEL_JOINTS)))
        self._commands.wait_for_all_acked(ARRIVAL_TIME)

    def destroy_node(self) -> None:
        """Send zero torques and destroy the node."""
        if self.context.ok():
            self.stop()
        self._maps.close()
        super().destroy_node()

    def _warm_up(self) -> None:
        """Compile and run everything once, so that the first update is as fast as others."""
        service = TractionService(load_traction_settings(self._values))
        joints = dict.fromkeys(JOINTS, 0.0)
        service.take_terrain(Terrain(np.zeros((50, 50)), 0.1, (-2.5, -2.5)))
        for now in (0.0, 0.01):
            service.take_joints(joints, dict.fromkeys(JOINTS, 0.1), now)
            service.take_attitude(0.0, 0.0, np.zeros(3), now)
            service.take_command(0.01, 0.0, now)
            service.take_odometry(np.zeros(4), 0.0, now)
            service.update(now)

    def _create_publishers(self) -> None:
        qos = topic_qos()
        self._commands = self.create_publisher(Float64MultiArray, "~/commands", qos)
        self._loads = self.create_publisher(Float64MultiArray, "~/wheel_loads", qos)
        self._used = self.create_publisher(Float64MultiArray, "~/friction_utilisation", qos)
        self._angles = self.create_publisher(Float64MultiArray, "~/contact_angles", qos)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", qos)
        # Messages are reused, which is safe because publishing copies them.
        zeros = np.zeros(len(WHEEL_JOINTS))
        self._contacts = np.zeros((2, len(WHEEL_JOINTS)))
        self._efforts, self._of_wheels = effort_commands(zeros, self._order), wheel_values(zeros)
        self._of_contacts = wheel_values(self._contacts, "angle, deviation")

    def _create_subscriptions(self) -> None:
        qos = sensor_qos()
        self.create_subscription(JointState, "joint_states", self._take_joints, qos)
        self.create_subscription(Imu, "imu", self._take_imu, qos)
        self.create_subscription(TwistStamped, "cmd_vel", self._take_command, qos)
        self.create_subscription(Odometry, "odometry", self._take_odometry, qos)
        profiles = map_subscriptions_qos(self._values.map_durability)
        for qos in profiles:
            events = SubscriptionEventCallbacks(use_default_callbacks=len(profiles) == 1)
            self.create_subscription(
                PointCloud2, "elevation_cloud", self._maps.offer, qos, event_callbacks=events,
                raw=True,
            )  # fmt: skip

    def _apply_parameters(self, parameters: TractionControllerParameters) -> None:
        self._values = parameters
        self._service.settings = load_traction_settings(parameters)

    def _take_joints(self, state: JointState) -> None:
        try:
            positions = joint_positions(state, SUSPENSION_JOINTS)
            self._service.take_joints(positions, joint_velocities(state, JOINTS), _now())
        except MessageError as error:
            self._service.refuse("joint_states", str(error))

    def _take_imu(self, imu: Imu) -> None:
        try:
            attitude = imu_to_attitude(imu)
            self._service.take_attitude(attitude.roll, attitude.pitch, attitude.rates, _now())
        except MessageError as error:
            self._service.refuse("imu", str(error))

    def _take_command(self, twist: TwistStamped) -> None:
        try:
            self._service.take_command(*twist_to_speeds(twist), _now())
        except MessageError as error:
            self._service.refuse("cmd_vel", str(error))

    def _take_odometry(self, odometry: Odometry) -> None:
        try:
            pose, deviation = odometry_to_pose(odometry, self._values.map_frame)
            self._service.take_odometry(pose, deviation, _now())
        except MessageError as error:
            self._service.refuse("odometry", str(error))
            self.get_logger().warning(f"odometry not used: {error}", throttle_duration_sec=5.0)

    def _prepare_map(self, cloud: PointCloud2) -> PreparedMap:
        """Prepare a map from a cloud; called in the intake's thread."""
        check_frame(cloud.header.frame_id, self._values.map_frame, "elevation_cloud")
        terrain = terrain_from_point_cloud(
            cloud, self._values.map_resolution, self._values.cell_height
        )
        return prepare_map(self._service.settings.rover, terrain)

    def _refuse_map(self, error: str) -> None:
        self.get_logger().error(f"elevation_cloud refused, the last map stays: {error}")

    def update(self) -> None:
        """Estimate, build, solve and publish; called by the timer."""
        start = time.perf_counter()
        try:
            prepared = self._maps.take()
            if prepared is not None:
                self._service.take_map(prepared)
            update = self._service.update(_now())
        except Exception as error:
            # After an internal error the wheels must not keep their last torque.
            update = self._service.rest(f"internal error: {type(error).__name__}: {error}")
        self._send(self._commands, self._efforts, update.torques[self._order])
        if update.answer is not None and update.estimate is not None:
            estimate, answer = update.estimate, update.answer
            self._send(self._loads, self._of_wheels, answer.loads)
            self._send(self._used, self._of_wheels, answer.utilisation)
            self._contacts[0] = estimate.angles
            np.sqrt(estimate.covariance.diagonal(), out=self._contacts[1])
            self._send(self._angles, self._of_contacts, self._contacts)
        self._statistics.take(update, start, time.perf_counter())
        self._tell(update)

    def _send(self, publisher, message: Float64MultiArray, values: np.ndarray) -> None:
        set_values(message, values)
        publisher.publish(message)

    def _tell(self, update: TractionUpdate) -> None:
        """Log changes of fault and warning, once each."""
        if update.fault != self._fault:
            if update.fault and not self._fault:
                self.get_logger().warning(f"zero torque: {update.fault}")
            elif not update.fault:
                self.get_logger().info("driving: all inputs are there")
            self._fault = update.fault
            self._publish_diagnostics()
        if update.warning and update.warning != self._warning:
            self.get_logger().warning(update.warning)
            self._warning = update.warning

    def _publish_diagnostics(self) -> None:
        name, stamp = self._service.settings.rover.name, self.get_clock().now().to_msg()
        self._diagnostics.publish(
            traction_diagnostics(self._statistics.describe(), self._fault, name, stamp)
        )


def _now() -> float:
    """Return the monotonic time that ages are measured with [s]."""
    return time.monotonic()


class _Stop:
    """Turns signals into a stop request; ROS's own handlers would end the context too early.

    The context must exist until the zero torques are sent.
    """

    def __init__(self) -> None:
        self.wanted = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.wanted = True


def main(words: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped; return 2 for a wrong argument or parameter, else 0."""
    stop = _Stop()
    node = None
    try:
        if read_words(NODE_NAME, words) == EXIT_OK:  # help was printed
            return EXIT_OK
        init_ros(words, signal_handler_options=SignalHandlerOptions.NO)
        rclpy.logging.get_logger(NODE_NAME).info(
            "compiling kernels; the first start takes longest"
        )
        node = TractionController()
        warn_of_disk(node.get_logger())
        node.take_priority()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        gc.collect()
        gc.freeze()
        sys.setswitchinterval(SWITCH_INTERVAL)
        while not stop.wanted:
            executor.spin_once(timeout_sec=0.1)
    except INPUT_ERRORS as error:
        rclpy.logging.get_logger(NODE_NAME).fatal(str(error))
        return EXIT_BAD_INPUT
    except ExternalShutdownException:
        return EXIT_OK
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
