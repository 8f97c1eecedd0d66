# SPDX-License-Identifier: Apache-2.0
"""What /traction_controller hears and what it publishes."""

import time
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Bool, Float64MultiArray, String

from msg_adapters.commands import doubles, joint_order, labelled_array, twist_to_speeds
from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.joints import JointNames, read_joint_map
from msg_adapters.sensors import ImuMounting, imu_to_attitude
from msg_adapters.stamps import NANOSECONDS, stamp_to_ns
from rover_physics.errors import RoverError
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_COUNT, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.traction.map_contacts import MapContactFinder
from rover_planner.parameters.shared import STOP
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.frames import NodeFrames
from rover_planner.ros.logs import TransitionLog
from rover_planner.ros.map_intake import CLOUD, MapIntake, are_gridded_alike
from rover_planner.ros.node import RoverNode
from rover_planner.ros.polled_topics import Take
from rover_planner.ros.qos import LATCHED_QOS, NEWEST_QOS, TOPIC_QOS, joints_qos
from rover_planner.ros.subscriptions import PublisherCheck, subscribe_to_map
from rover_planner.traction.input_monitor import StampError
from rover_planner.traction.traction_service import (
    CMD_VEL,
    DRIVING,
    IMU,
    JOINT_STATES,
    ODOMETRY,
    TractionCommand,
    TractionService,
)

JOINTS = (*SUSPENSION_JOINTS, *WHEEL_JOINTS)
ANGLES = (*SUSPENSION_JOINTS, *STEERING_JOINTS)
"""Joints whose positions are read; a rover has the steering joints of its steered wheels."""
LONGEST_PERIOD = 0.1
"""Time between two readings of joint states, at most [s]."""
MENDS: dict[type, str] = {
    Twist: "set parameter cmd_vel_stamped to false",
    TwistStamped: "set parameter cmd_vel_stamped to true",
}
"""What to do about publishers of these types that are not heard."""


class TractionInputs:
    """Takes joint states, attitude, commands and odometry; nothing in them ends the node."""

    def __init__(
        self,
        node: RoverNode[TractionControllerParameters],
        service: TractionService,
        maps: MapIntake,
        frames: NodeFrames,
    ):
        """Subscribe to all inputs of a node; `frames` brings odometry to the frame of the map."""
        self._node, self._service, self._frames, parameters = node, service, frames, node.values
        arm = service.settings.rover.manipulator
        known = (*JOINTS, *STEERING_JOINTS, *(() if arm is None else arm.joints))
        sign = parameters.steering_sign
        self.joint_names = read_joint_map(parameters.joint_map, known, sign)
        """Names of the joints in messages."""
        self._heard = frozenset(self.joint_names.robot_names({*JOINTS, *ANGLES}))
        self._map_frame, self._base_frame = parameters.map_frame, parameters.base_frame
        self._mounting = ImuMounting(
            parameters.imu_frame or parameters.base_frame, parameters.imu_mounting
        )
        self._twist = TwistStamped if parameters.cmd_vel_stamped else Twist
        self._log = TransitionLog(node.get_logger())
        subscribe_to_map(node, PointCloud2, CLOUD, maps.offer)
        self.publishers = self._subscribe()
        """Looks for publishers that are not heard."""

    def _subscribe(self) -> PublisherCheck:
        """Subscribe to all but the map; return what looks for publishers that are not heard."""
        topics: tuple[tuple[type, str, Take, QoSProfile], ...] = (
            (JointState, JOINT_STATES, self._take_joints, joints_qos(LONGEST_PERIOD)),
            (Imu, IMU, self._take_imu, NEWEST_QOS),
            (self._twist, CMD_VEL, self._take_command, NEWEST_QOS),
            (Odometry, ODOMETRY, self._take_odometry, NEWEST_QOS),
            (Bool, STOP, self._take_stop, TOPIC_QOS),
        )
        for topic in topics:
            self._node.heard.subscribe(*topic, refuse=self._refuse)
        kinds = {name: kind for kind, name, *_ in topics} | {CLOUD: PointCloud2}
        return PublisherCheck(self._node, kinds, MENDS)

    def _refuse(self, name: str, error: Exception, now: float) -> None:
        """Keep why a message is not used; a stamp of no use is no fault by itself."""
        if isinstance(error, StampError):
            self._service.monitor.ignore(name, str(error))
            return
        reason = str(error)
        if not isinstance(error, RoverError):
            reason = f"internal error: {self._node.guard.report(name, error)}"
        self._service.monitor.refuse(name, reason, now)
        if name == ODOMETRY:  # the others are faults, which the node logs
            self._log.update(name, f"odometry not used: {reason}", "odometry is used again", now)

    def _find_time(
        self, name: str, stamp: int | None, now: float, *, merged: bool = False
    ) -> float:
        waited = round(NANOSECONDS * (time.monotonic() - now))
        clock = self._node.get_clock().now().nanoseconds - waited
        monitor = self._service.monitor
        return monitor.find_time(name, stamp or 0, clock, now, merged=merged)

    def _take_joints(self, state: Any, now: float) -> None:
        if not self._heard.intersection(state.name):  # an arm's message, for example
            return
        stamp = stamp_to_ns(state.header.stamp) or 0
        measured = self._find_time(JOINT_STATES, stamp, now, merged=True)
        positions = self.joint_names.positions(state, ANGLES)
        rates = self.joint_names.velocities(state, JOINTS)
        self._service.take_joints(positions, rates, measured, stamp)

    def _take_imu(self, imu: Any, now: float) -> None:
        measured = self._find_time(IMU, stamp_to_ns(imu.header.stamp), now)
        attitude = imu_to_attitude(imu, self._mounting)
        self._service.take_attitude(attitude.roll, attitude.pitch, attitude.rates, measured)

    def _take_command(self, twist: Any, now: float) -> None:
        if self._twist is TwistStamped:
            now = self._find_time(CMD_VEL, stamp_to_ns(twist.header.stamp), now)
        self._service.take_command(*twist_to_speeds(twist), now)

    def _take_stop(self, message: Bool, now: float) -> None:
        self._service.take_stop(message.data, now)

    def _take_odometry(self, odometry: Any, now: float) -> None:
        measured = self._find_time(ODOMETRY, stamp_to_ns(odometry.header.stamp), now)
        if odometry.header.frame_id != self._map_frame:
            self._frames.listen()  # only then: /tf of a whole robot costs the loop time
        pose, deviation = self._frames.take_odometry(odometry, self._base_frame)
        self._service.take_odometry(pose[[0, 1, 2, 5]], deviation, measured)
        self._log.update(ODOMETRY, "", "odometry is used again", now)


class TractionMaps(MapIntake):
    """Prepares clouds for the controller in a thread of their own."""

    def __init__(
        self,
        node: RoverNode[TractionControllerParameters],
        service: TractionService,
        frames: NodeFrames,
    ):
        """Begin without a map.

        Args:
            node: The node.
            service: Knows rover and parameters for which maps are prepared.
            frames: Knows where the frames of clouds are on the map.
        """
        self._service = service
        self._ready: MapContactFinder | None = None
        super().__init__(node.get_logger(), frames)

    def apply(self, before: TractionControllerParameters) -> None:
        """Prepare the last map again if a parameter of it has changed."""
        if not are_gridded_alike(before, self._service.settings.parameters):
            self.repeat()

    def take(self) -> MapContactFinder | None:
        """Return the map that was prepared since the last call, None if there is none."""
        ready, self._ready = self._ready, None
        return ready

    def prepare(self, cloud: Any, source: Rigid | None) -> None:
        """Prepare a map from a cloud; called in the thread."""
        settings, values = self._service.settings, self._service.settings.parameters
        move = None if source is None else source.matrix
        terrain = terrain_from_point_cloud(cloud, values.map_resolution, values.cell_height, move)
        self._ready = MapContactFinder(settings.rover, terrain)


STANDING_WHEELS = np.zeros(WHEEL_COUNT)
"""Rates of wheels that stand [rad/s]."""


class TractionTopics:
    """Publishers of commands, state, brake and forces; any thread may write commands."""

    def __init__(
        self,
        node: RoverNode[TractionControllerParameters],
        service: TractionService,
        names: JointNames,
    ):
        """Create the publishers; joints have these names and signs in messages.

        Raises:
            MessageError: The parameter joints does not name the wheel joints.
        """

        def publish(name: str) -> Publisher:
            return node.create_publisher(Float64MultiArray, name, TOPIC_QOS)

        self._service, self._names = service, names
        self._order = joint_order(node.values.joints, names)
        self._signs = names.signs(WHEEL_JOINTS)[self._order]
        self.commands = publish("~/commands")
        self._velocities = publish("~/velocity_commands")
        self._steering = publish("~/steering_commands")
        self.brake = node.create_publisher(Bool, "~/brake", LATCHED_QOS)
        self.state = node.create_publisher(String, "~/state", LATCHED_QOS)
        self.diagnostics = node.create_publisher(DiagnosticArray, "diagnostics", TOPIC_QOS)
        self._loads = publish("~/wheel_loads")
        self._used = publish("~/friction_utilisation")
        self._angles = publish("~/contact_angles")
        self._last_state: tuple[str, bool] | None = None

    def send(self, command: TractionCommand) -> None:
        """Publish torques, and rates and steering angles for drives that hold those."""
        service, names = self._service, self._names
        if command.state != DRIVING:
            self.write(command.torques, command.brake, command.state)
            return
        self.write(command.torques, command.brake, command.state, service.wanted_rates)
        if self._steering.get_subscription_count():
            angles = service.course.steering_aims(service.wanted)
            if angles is not None:
                joints = steering_joints(service.settings.rover)
                told = names.signs(joints) * (angles - names.offsets(joints))
                self._steering.publish(Float64MultiArray(data=doubles(told)))

    def write(
        self, torques: Floats, brake: bool, state: str, rates: Floats = STANDING_WHEELS
    ) -> None:
        """Publish torques (6,) [N m] and rates (6,) [rad/s]; brake and state if changed."""
        if self._velocities.get_subscription_count():
            self._velocities.publish(self._to_message(rates))
        self.commands.publish(self._to_message(torques))
        if self._last_state != (state, brake):
            told = self._last_state = state, brake
            self.brake.publish(Bool(data=brake))
            self.state.publish(String(data=state))
            if self._last_state is not told:  # another thread wrote meanwhile: which came last?
                self._last_state = None

    def _to_message(self, values: Floats) -> Float64MultiArray:
        """Return values of the wheels (6,) in the order and with the signs of messages."""
        return Float64MultiArray(data=doubles(self._signs * values[self._order]))

    def publish_forces(self, command: TractionCommand) -> None:
        """Publish loads, utilisation and contact angles of a rover that drives, to who listens."""
        estimate, answer = command.estimate, command.answer
        if estimate is None or answer is None:
            return
        for publisher, values in ((self._loads, answer.loads), (self._used, answer.utilisation)):
            if publisher.get_subscription_count():
                publisher.publish(labelled_array(values, "wheel"))
        if self._angles.get_subscription_count():
            deviations = np.sqrt(estimate.covariance.diagonal())
            contacts = np.array([estimate.angles, deviations])
            self._angles.publish(labelled_array(contacts, "angle, deviation", "wheel"))
