# SPDX-License-Identifier: Apache-2.0
"""The node /ground_learner: learns the ground from a rover's sensors while it drives."""

import json
import math
import sys
import time
from dataclasses import asdict
from functools import partial
from typing import Any

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Bool, String

from msg_adapters.commands import twist_to_speeds
from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.frames import check_frame
from msg_adapters.joints import read_joint_map
from msg_adapters.sensors import BASE_FRAME, ImuMounting, planar_odometry
from msg_adapters.stamps import NANOSECONDS, ns_to_stamp, stamp_to_ns
from rover_physics.errors import RoverError
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.rover_file import load_rover
from rover_planner.learning.drive_log import YAW, X, Y
from rover_planner.learning.ground_learner import GroundLearner
from rover_planner.learning.learned_file import describe
from rover_planner.learning.soil_fit import SoilFit
from rover_planner.learning.stuck_watch import find_place_ahead
from rover_planner.learning.wheel_odometry import WheelOdometry
from rover_planner.nodes.running import run_node
from rover_planner.nodes.warm_up import LEARNING, load_kernels
from rover_planner.parameters.ground_learner import GroundLearnerParameters
from rover_planner.ros.map_intake import CLOUD, read_message
from rover_planner.ros.node import RoverNode
from rover_planner.ros.qos import (
    LATCHED_QOS,
    NEWEST_QOS,
    POLLED_QOS,
    RESULT_QOS,
    TOPIC_QOS,
    joints_qos,
)
from rover_planner.ros.row_collector import RowCollector
from rover_planner.ros.subscriptions import subscribe_to_map

NODE_NAME = "ground_learner"
ESTIMATE, EMERGENCY_STOP = "traverse_server/ground_estimate", "traction_controller/emergency_stop"
"""Topics of the estimate, and of the stop of a rover that is stuck."""
MARK_PLACE = "traverse_server/mark_place"
"""Topic of places that are impassable."""
POLLING = 0.1
"""Time between two looks at the sensors, as long as the learner takes to a block [s]."""
PERIOD = 1.0
"""Time between two estimates [s]; that the rover is stuck is told at once."""
COMMAND_AGE = 0.5
"""Age from which a command is none [s]."""


class GroundLearnerNode(RoverNode[GroundLearnerParameters]):
    """Connects a GroundLearner to ROS; nothing that arrives ends the node."""

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, GroundLearnerParameters, **node_arguments)
        values = self.values
        load_kernels(LEARNING, (), self.get_logger().info)
        self._rover = load_rover(values.rover)
        if values.soil:
            SoilFit(self._rover, 1.0, values.soil)  # refuses a name that is wrong
        self._told = values.friction or self._rover.friction
        known = (*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS)
        self._rows = RowCollector(
            read_joint_map(values.joint_map, known, values.steering_sign),
            ImuMounting(values.imu_frame or BASE_FRAME, values.imu_mounting),
        )
        self.learner: GroundLearner | None = None
        """The estimator; None before the first map."""
        self.heard_until = 0.0
        """Time of the last odometry [s]."""
        self._commanded, self._command_time, self._sent, self._stuck = 0.0, -1e9, -1e9, ""
        self._estimates = self.create_publisher(String, ESTIMATE, LATCHED_QOS)
        self._stops = self.create_publisher(Bool, EMERGENCY_STOP, LATCHED_QOS)
        self._marks = self.create_publisher(String, MARK_PLACE, RESULT_QOS)
        self._wheels = WheelOdometry(self._rover)
        self._wheels_told = -math.inf  # time of the last odometry of the wheels that was sent
        self._wheel_odometry = self.create_publisher(Odometry, "~/odometry", TOPIC_QOS)
        hear = self.heard.subscribe
        hear(TwistStamped, "cmd_vel", self._take_command, NEWEST_QOS)
        hear(JointState, "joint_states", self._take_joints, joints_qos(POLLING))
        hear(Imu, "imu", self._take_imu, POLLED_QOS)
        hear(Odometry, "odometry", self._take_odometry, POLLED_QOS)
        # By ROS time: where /clock runs fast, more comes in a steady time than queues hold.
        self.loop = self.create_timer(POLLING, self._read_sensors)
        subscribe_to_map(self, PointCloud2, CLOUD, self._take_map)
        self.follow_changes(lambda _: None, lambda _: None)
        self.get_logger().info(f"ready for rover {self._rover.name}")

    def _take_map(self, data: bytes) -> None:
        values = self.values
        try:
            cloud = read_message(data, PointCloud2)
            check_frame(cloud.header.frame_id, values.map_frame, CLOUD)
            terrain = terrain_from_point_cloud(cloud, values.map_resolution, values.cell_height)
            if self.learner is None:
                soil = values.soil or None
                self.learner = GroundLearner(self._rover, terrain, self._told, soil)
            else:
                self.learner.change_map(terrain)
        except RoverError as error:
            self.get_logger().warning(f"{CLOUD} not used: {error}", throttle_duration_sec=5.0)

    def _take_command(self, twist: Any, arrival: float) -> None:
        self._commanded, self._command_time = twist_to_speeds(twist)[0], arrival

    def _read_sensors(self) -> None:
        """Take what the sensors sent, and tell where the wheels say that the rover is."""
        learner, wheels = self.learner, self._wheels
        if learner is not None:
            is_fresh = time.monotonic() - self._command_time < COMMAND_AGE
            learner.commanded = self._commanded if is_fresh else None
        self.heard.poll()
        if not abs(wheels.time - self._wheels_told) > 0.0:
            return
        self._wheels_told = wheels.time
        message = planar_odometry(
            wheels.pose,
            wheels.covariance,
            (wheels.speed, wheels.speed_deviation),
            wheels.yaw_rate,
            self.values.odometry_frame,
            ns_to_stamp(round(wheels.time * NANOSECONDS)),
        )
        self._wheel_odometry.publish(message)

    def _take_joints(self, joints: Any, _arrival: float) -> None:
        self._rows.take_joints(joints, self.seconds)

    def _take_imu(self, imu: Any, _arrival: float) -> None:
        """Take attitude and yaw rate, and go on by what the wheels turned."""
        self._rows.take_imu(imu, self.seconds)
        yaw_rate = self._rows.yaw_rate
        if not math.isnan(yaw_rate):
            row = self._rows.at(self._time_of(imu) / NANOSECONDS, self.seconds)
            self._wheels.take(row, yaw_rate)

    def _time_of(self, message: Any) -> int:
        """Return the stamp of a message, or the present time if it has none [ns]."""
        return stamp_to_ns(message.header.stamp) or self.get_clock().now().nanoseconds

    def _take_odometry(self, odometry: Any, _arrival: float) -> None:
        now = self._time_of(odometry) / NANOSECONDS
        row = self._rows.take_odometry(odometry, now, self.seconds, self.values.map_frame)
        self.heard_until = now
        self._wheels.learn(row[[X, Y, YAW]])
        learner = self.learner
        if learner is not None and learner.take(row):
            self._tell(learner, row, now)

    def _tell(self, learner: GroundLearner, row: Floats, now: float) -> None:
        """Publish the estimate from time to time, and at once if the rover gets stuck."""
        stuck, before = learner.stuck, self._stuck
        self._stuck = stuck
        if stuck and not before:
            self.get_logger().warning(f"the rover is stuck: {stuck}")
            if self.values.stop_when_stuck:
                self._stops.publish(Bool(data=True))
            if self.values.mark_when_stuck:
                rolling = 0.0 if learner.window is None else learner.window.rolling.mean()
                place = find_place_ahead(self._rover, row, rolling, stuck)
                self._marks.publish(String(data=json.dumps(asdict(place))))
        if not 0.0 <= now - self._sent < PERIOD or bool(stuck) != bool(before):
            self._sent = now
            friction = learner.estimate.friction
            self._wheels.friction, self._wheels.friction_deviation = friction.mean, friction.std
            contents = describe(learner.estimate, self._told)
            self._estimates.publish(String(data=json.dumps(contents)))


main = partial(run_node, NODE_NAME, GroundLearnerNode)
"""Runs the node until it is stopped; returns 2 for a wrong argument or parameter, else 0."""


if __name__ == "__main__":
    sys.exit(main())
