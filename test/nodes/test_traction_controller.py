"""The traction controller over DDS: bad inputs stop the wheels, said once; so does its end."""

import copy
import math
import os
import signal
import subprocess
import sys

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Float64MultiArray

from msg_adapters.elevation import terrain_to_point_cloud
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.ros.qos import map_qos, sensor_qos, topic_qos
from support.ros_fixtures import domain_id, wait_until
from support.rough_grounds import plane

RATE = 50.0
CYCLES_IN_A_TENTH = 5
JOINTS = (*SUSPENSION_JOINTS, *WHEEL_JOINTS)


class Rover(Node):
    """Sends what a creeping rover measures, as told, and hears commands and what is logged."""

    def __init__(self, ros):
        super().__init__("rover", context=ros.context)
        self.joints = JointState(name=list(JOINTS))
        self.joints.position = [0.0] * len(JOINTS)
        self.joints.velocity = [0.0] * len(SUSPENSION_JOINTS) + [0.2] * len(WHEEL_JOINTS)
        self.imu = Imu()
        self.twist = TwistStamped()
        self.twist.twist.linear.x = 0.03
        self.commands, self.log = [], []
        self._senders = [
            (self.create_publisher(JointState, "joint_states", sensor_qos()), "joints"),
            (self.create_publisher(Imu, "imu", sensor_qos()), "imu"),
            (self.create_publisher(TwistStamped, "cmd_vel", sensor_qos()), "twist"),
        ]
        self.create_subscription(
            Float64MultiArray, "/traction_controller/commands", self._hear, topic_qos()
        )
        self.create_subscription(Log, "/rosout", self._read, 100)
        self.create_timer(1.0 / RATE, self._send)
        ros.spin(self)

    def _send(self):
        for publisher, name in self._senders:
            publisher.publish(getattr(self, name))

    def _hear(self, message):
        self.commands.append(max(map(abs, message.data)))

    def _read(self, message):
        if message.name == "traction_controller":
            self.log.append(message.msg)

    def said(self, text):
        return sum(text in line for line in self.log)

    def wait_for_torque(self):
        count = len(self.commands)
        wait_until(lambda: len(self.commands) > count + 3 and self.commands[-1] > 0.0, "torque")

    def wait_for_zeros(self, count):
        wait_until(lambda: not any(self.commands[-count:]), f"{count} zeros")


@pytest.fixture
def rover(ros):
    return Rover(ros)


@pytest.fixture
def controller(ros, rover):
    # Stale inputs are not what is looked at here: a busy machine is to make no difference.
    parameters = [Parameter("rate", value=RATE), Parameter("timeout", value=1.0)]
    node = TractionController(context=ros.context, parameter_overrides=parameters)
    ros.spin(node)
    rover.wait_for_torque()
    return node


def nan_rate(rover):
    rover.joints.velocity[len(SUSPENSION_JOINTS) + 2] = math.nan


def nan_angle(rover):
    rover.joints.position[0] = math.nan


def nan_attitude(rover):
    rover.imu.orientation.w = math.nan


def nan_turning(rover):
    rover.imu.angular_velocity.y = math.nan


def nan_speed(rover):
    rover.twist.twist.linear.x = math.nan


def no_wheel(rover):
    kept = [i for i, name in enumerate(JOINTS) if name != "rear_left_wheel"]
    whole = rover.joints
    rover.joints = JointState(
        name=[JOINTS[i] for i in kept],
        position=[whole.position[i] for i in kept],
        velocity=[whole.velocity[i] for i in kept],
    )


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (nan_rate, "velocity nan of front_right_wheel"),
        (nan_angle, "position nan of rocker_right"),
        (nan_attitude, "imu has orientation"),
        (nan_turning, "imu has angular velocity"),
        (nan_speed, "cmd_vel has linear.x nan"),
        (no_wheel, "no velocity of rear_left_wheel"),
    ],
)
def test_what_cannot_be_used_stops_the_wheels_is_said_once_and_passes_by_itself(
    rover, controller, spoil, text
):
    kept = [copy.deepcopy(message) for message in (rover.joints, rover.imu, rover.twist)]
    before, told = len(rover.commands), rover.said("driving: all inputs are there")
    spoil(rover)
    rover.wait_for_zeros(20)
    assert sum(size > 0.0 for size in rover.commands[before:]) <= CYCLES_IN_A_TENTH
    assert text in controller.statistics.last.fault
    wait_until(lambda: rover.said(text), "the reason in the log")
    assert rover.said(f"zero torque: {controller.statistics.last.fault}") == 1
    rover.joints, rover.imu, rover.twist = kept
    rover.wait_for_torque()
    wait_until(
        lambda: rover.said("driving: all inputs are there") == told + 1, "the good news in the log"
    )
    assert rover.said(text) == 1


def test_a_node_that_is_stopped_sends_zeros_and_no_more(rover, controller):
    controller.stop()
    wait_until(lambda: rover.commands[-1] == 0.0, "zeros")
    updates = controller.statistics.updates
    rover.wait_for_zeros(1)
    assert controller.statistics.updates == updates


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_process_that_is_told_to_end_sends_zeros_last(rover, how):
    process = subprocess.Popen(
        [sys.executable, "-m", "rover_planner.nodes.traction_controller"],
        env=os.environ | {"ROS_DOMAIN_ID": str(domain_id())},
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_until(lambda: rover.commands, "the node", 120.0)
        rover.wait_for_torque()
        process.send_signal(how)
        assert process.wait(timeout=20.0) == 0
    finally:
        process.kill()
        process.wait()
    wait_until(lambda: rover.commands[-1] == 0.0, "zeros")


def test_a_map_is_used_though_it_comes_twice_and_a_bad_one_leaves_it(ros, rover, controller):
    cloud = terrain_to_point_cloud(plane(0.0, 0.0, half=3.0), "map", Time())
    sender = rover.create_publisher(PointCloud2, "elevation_cloud", map_qos())
    odometry = rover.create_publisher(Odometry, "odometry", sensor_qos())
    place = Odometry(child_frame_id="base_link")
    place.header.frame_id = "map"
    place.pose.pose.position.z = 0.3
    sender.publish(cloud)

    def source_is_map():
        odometry.publish(place)
        last = controller.statistics.last
        return last.estimate is not None and last.estimate.source == "map"

    wait_until(source_is_map, "the map")
    cloud.header.frame_id = "elsewhere"
    sender.publish(cloud)
    wait_until(lambda: rover.said("elevation_cloud refused"), "the refusal in the log")
    wait_until(source_is_map, "the last map")
