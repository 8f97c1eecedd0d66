# SPDX-License-Identifier: Apache-2.0
"""The node ground_learner tells what a drive over ROS shows, and stops a rover that is stuck."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Bool, String

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.sensors import imu_message
from msg_adapters.stamps import ns_to_stamp
from rover_physics.names import WHEEL_JOINTS
from rover_physics.numerics.quaternions import xyzw_from_rpy
from rover_physics.rover.steered_drive import SteeredDrive
from rover_physics.rover.steering_joints import steered_wheels, steering_joints
from rover_planner.learning.drive_log import PITCH, RATES, ROLL, TIME, YAW, X
from rover_planner.nodes import ground_learner
from rover_planner.planning.learned_ground import parse_learned
from rover_planner.planning.marked_places import parse_place
from rover_planner.ros.qos import LATCHED_QOS, TOPIC_QOS
from rover_planner.ros.row_collector import RowCollector
from support.grounds import plane
from support.learning_drives import climb
from support.messages import odometry_at, row_messages
from support.ros_fixtures import RosRun, hear
from support.rovers import LSR1
from support.waiting import repeat_until, wait_until

SLOPE = 0.3
BEGIN = 1_700_000_000.0
"""Time of the first message [s]."""


class Rover(Node):
    """Sends the rows of a drive, and hears what is learned."""

    def __init__(self, ros: RosRun):
        super().__init__("rover", context=ros.context)
        self.map = self.create_publisher(PointCloud2, "elevation_cloud", LATCHED_QOS)
        kinds = {"joint_states": JointState, "odometry": Odometry, "imu": Imu}
        self.senders = {n: self.create_publisher(k, n, TOPIC_QOS) for n, k in kinds.items()}
        self.estimates = hear(self, String, ground_learner.ESTIMATE, LATCHED_QOS)
        self.wheels = hear(self, Odometry, "ground_learner/odometry", TOPIC_QOS)
        self.marks = hear(self, String, ground_learner.MARK_PLACE, LATCHED_QOS)
        self.stops = hear(self, Bool, ground_learner.EMERGENCY_STOP, LATCHED_QOS)

    @property
    def estimate(self) -> dict:
        """The last estimate."""
        return json.loads(self.estimates[-1].data)

    def is_heard(self) -> bool:
        """Return whether all topics are connected."""
        return all(s.get_subscription_count() for s in (*self.senders.values(), self.map))

    def send(self, row: np.ndarray, begin: float = BEGIN) -> None:
        """Send what a row holds; the joints first, which the row of the odometry has."""
        joints, odometry = row_messages(row, begin)
        self.senders["joint_states"].publish(joints)
        attitude = xyzw_from_rpy(*row[[ROLL, PITCH, YAW]])
        self.send_imu(attitude, np.zeros(3), odometry.header.stamp)
        self.senders["odometry"].publish(odometry)

    def send_imu(self, attitude, rates: np.ndarray, stamp, frame: str = "base_link") -> None:
        """Send attitude (quaternion) and angular velocity (3,) [rad/s] of an IMU."""
        imu = imu_message(attitude, rates, 3.7, 1e-3, stamp)
        imu.header.frame_id = frame
        self.senders["imu"].publish(imu)


def drive(node: ground_learner.GroundLearnerNode, rover: Rover, rows: np.ndarray) -> None:
    """Send rows, each until it has arrived: of those that come at once the node may miss some."""
    for row in rows:
        until = BEGIN + row[TIME] - 0.05
        repeat_until(partial(rover.send, row), lambda t=until: node.heard_until > t, "odometry")


def test_a_drive_is_learned_and_a_rover_that_gets_stuck_is_stopped_and_its_place_marked(ros):
    node = ros.start(ground_learner.GroundLearnerNode, stop_when_stuck=True, mark_when_stuck=True)
    rover = ros.spin(Rover(ros))
    wait_until(rover.is_heard, "the node's subscriptions")
    ground = plane(SLOPE, 0.0, half=3.0)
    ground = replace(ground, ground_class=np.full(ground.elevation.shape, 7.0))
    rover.map.publish(terrain_to_point_cloud(ground, "map", ns_to_stamp(int(BEGIN * 1e9))))
    wait_until(lambda: node.learner is not None, "the map")
    rows = climb(LSR1, SLOPE, 12.0)[::5]
    rows[60:, X] = rows[60, X] + 1e-4 * np.random.default_rng(1).standard_normal(60)
    drive(node, rover, rows[:60])
    wait_until(lambda: rover.estimates, "an estimate")
    assert not rover.stops and not rover.estimate["stuck"]
    way = rows[59, X] - rows[0, X]
    wait_until(
        lambda: rover.wheels and abs(rover.wheels[-1].pose.pose.position.x - way) < 0.05,
        "the odometry of the wheels",
    )
    assert rover.wheels[-1].header.frame_id == "odom"
    assert 0.0 < rover.wheels[-1].pose.covariance[0] < 0.1**2
    drive(node, rover, rows[60:])
    wait_until(lambda: rover.stops == [Bool(data=True)], "the stop")
    wait_until(lambda: rover.estimate["stuck"], "that it is stuck")
    wait_until(lambda: rover.marks, "the mark")
    place = parse_place(rover.marks[0].data, ground_learner.MARK_PLACE)
    assert place.x - rows[60, X] == pytest.approx(place.radius, abs=0.01)
    assert "stays" in place.reason and place.date.startswith("2023-11-14")
    last = rover.estimate
    assert 6.0 < last["immobilised_time"] - BEGIN < 8.0
    assert last["friction"]["low"] > 0.5 * SLOPE
    read = parse_learned(json.dumps(last), ground_learner.ESTIMATE)  # as a server does
    assert read.classes.keys() == {7} and read.classes[7].low == pytest.approx(read.low)
    told, set_back = (len(rover.estimates), len(rover.wheels)), BEGIN - 1000.0
    row = rows[0]

    def are_told() -> bool:
        row[TIME] += 0.05
        rover.send(row, set_back)
        return len(rover.estimates) > told[0] + 1 and len(rover.wheels) > told[1] + 1

    wait_until(are_told, "what is told after the clock was set back")


def test_joints_whose_driver_has_ended_were_not_measured():
    rows, joints = RowCollector(), JointState(name=[*WHEEL_JOINTS], velocity=[0.3] * 6)
    rows.take_joints(joints, 10.0)
    assert (rows.at(0.0, 10.4)[RATES] == 0.3).all()
    for late in (10.6, 9.0):  # or the clock was set back
        assert np.isnan(rows.take_odometry(odometry_at([1.0, 0.0, 0.0]), 0.0, late)[RATES]).all()
    rows.take_joints(joints, 9.1)
    row = rows.at(0.0, 9.2)
    assert (row[RATES] == 0.3).all() and row[X] == 1.0


def test_steering_and_imu_are_read_as_the_parameters_say(ros):
    values = {"steering_sign": "right", "imu_frame": "imu_link", "imu_mounting": [np.pi, 0.0, 0.0]}
    ros.start(ground_learner.GroundLearnerNode, **values)
    rover = ros.spin(Rover(ros))
    wait_until(rover.is_heard, "the node's subscriptions")
    speed, yaw_rate = 0.05, 0.06
    aims = SteeredDrive(LSR1).aim(speed, yaw_rate)
    joints = JointState(name=[*WHEEL_JOINTS, *steering_joints(LSR1)])
    joints.position = [*np.zeros(6), *-aims.angles[steered_wheels(LSR1)]]
    joints.velocity = [*aims.speeds / LSR1.wheel.radius, *np.zeros(4)]
    for time_now in (BEGIN, BEGIN + 0.05):
        rover.senders["joint_states"].publish(joints)
        stamp = ns_to_stamp(round(time_now * 1e9))
        rates = np.array([0.0, 0.0, -yaw_rate])
        rover.send_imu(xyzw_from_rpy(*values["imu_mounting"]), rates, stamp, "imu_link")
        rover.send_imu(xyzw_from_rpy(0.0, 0.0, 0.0), rates, stamp, "camera")
    wait_until(lambda: rover.wheels, "the odometry of the wheels")
    twist = rover.wheels[-1].twist.twist
    assert twist.angular.z == pytest.approx(yaw_rate)
    assert twist.linear.x == pytest.approx(speed, rel=0.01)
