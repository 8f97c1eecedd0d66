# SPDX-License-Identifier: Apache-2.0
"""A robot with its own joint names, mirrored motors and an encoder offset is driven over DDS.

The mock hardware takes commands as forward_command_controllers of the shipped controllers.yaml do,
and sends joint states as their broadcaster does.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

from rover_physics import load_rover
from rover_physics.names import WHEEL_JOINTS
from rover_physics.rover.steered_drive import SteeredDrive
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.ros.qos import sensor_qos, topic_qos
from support.ros_fixtures import PATIENT
from support.waiting import wait_until

CONFIG = Path(__file__).resolve().parents[3] / "config" / "ros2_control"
HARDWARE = {
    "rocker_r": ("rocker_right", 1, 0.02),
    "rocker_l": ("rocker_left", -1, 0.0),
    "bogie_r": ("bogie_right", 1, 0.0),
    "bogie_l": ("bogie_left", -1, 0.0),
    "rr_drive": ("rear_right_wheel", 1, 0.0),
    "mr_drive": ("middle_right_wheel", 1, 0.0),
    "fr_drive": ("front_right_wheel", 1, 0.0),
    "rl_drive": ("rear_left_wheel", -1, 0.0),
    "ml_drive": ("middle_left_wheel", -1, 0.0),
    "fl_drive": ("front_left_wheel", -1, 0.0),
    "rr_steer": ("rear_right_steering", 1, 0.0),
    "fr_steer": ("front_right_steering", 1, 0.0),
    "rl_steer": ("rear_left_steering", -1, 0.0),
    "fl_steer": ("front_left_steering", -1, 0.0),
}
"""How the robot is built: robot joint, model joint, sign and offset of the model's angle."""


NAMES = {model: robot for robot, (model, _, _) in HARDWARE.items()}


def joints_of(group):
    """Return the robot's joints in the order of a group of the shipped file."""
    contents = yaml.safe_load((CONFIG / "controllers.yaml").read_text())
    return [NAMES[joint] for joint in contents[group]["ros__parameters"]["joints"]]


class KinematicRobot(Node):
    """The joints of a robot whose motors reach every commanded rate and angle at once."""

    def __init__(self, ros, speed, yaw_rate):
        super().__init__("hardware", context=ros.context)
        self.angles = dict.fromkeys((model for model, _, _ in HARDWARE.values()), 0.0)
        self.rates = dict.fromkeys(self.angles, 0.0)
        self.commands: dict[str, dict[str, float]] = {}
        """Last values of each group by model joint."""
        self._states = self.create_publisher(JointState, "joint_states", sensor_qos())
        self._imu = self.create_publisher(Imu, "imu", sensor_qos())
        for group in ("wheel_efforts", "wheel_velocities", "steering_positions"):
            joints = joints_of(group)
            self.create_subscription(
                Float64MultiArray, f"/{group}/commands", self._taker(group, joints), topic_qos()
            )
        self._wanted = self.create_publisher(TwistStamped, "cmd_vel", sensor_qos())
        self.twist = TwistStamped()
        self.twist.twist.linear.x, self.twist.twist.angular.z = speed, yaw_rate
        self.create_timer(0.02, self._step)

    def _taker(self, group, joints):
        def take(message):
            assert len(message.data) == len(joints)  # else a controller is deactivated
            values = {}
            for robot, value in zip(joints, message.data, strict=True):
                model, sign, offset = HARDWARE[robot]
                values[model] = sign * value + (offset if group == "steering_positions" else 0.0)
            self.commands[group] = values

        return take

    def _step(self):
        """Send the state of all joints as the robot names them, in an order of its own."""
        self.angles |= self.commands.get("steering_positions", {})
        self.rates |= self.commands.get("wheel_velocities", {})
        state = JointState(name=sorted(HARDWARE))
        for robot in state.name:
            model, sign, offset = HARDWARE[robot]
            state.position.append(sign * (self.angles[model] - offset))
            state.velocity.append(sign * self.rates[model])
        self._states.publish(state)
        self._imu.publish(Imu())
        self._wanted.publish(self.twist)


def start_controller(ros):
    """Start a controller of the shipped configuration."""
    groups = {
        "commands": "wheel_efforts",
        "velocity_commands": "wheel_velocities",
        "steering_commands": "steering_positions",
    }
    words = ["--ros-args"]
    for topic, group in groups.items():
        words += ["-r", f"~/{topic}:=/{group}/commands"]
    values = PATIENT | {
        "joint_map": [
            f"{model}:{robot}:{sign}:{offset}" for robot, (model, sign, offset) in HARDWARE.items()
        ],
        "joints": joints_of("wheel_efforts"),
        "enabled_at_start": True,
    }
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    return ros.spin(
        TractionController(context=ros.context, parameter_overrides=parameters, cli_args=words)
    )


def test_rates_and_steering_angles_are_those_of_the_commanded_motion(ros):
    speed, yaw_rate = 0.03, 0.03
    robot = ros.spin(KinematicRobot(ros, speed, yaw_rate))
    controller = start_controller(ros)
    aims = SteeredDrive(load_rover("lsr1")).aim(speed, yaw_rate)
    rates = aims.speeds / load_rover("lsr1").wheel.radius

    def is_there():
        found = robot.commands.get("wheel_velocities", {})
        return found and np.allclose([found[one] for one in WHEEL_JOINTS], rates, atol=1e-6)

    wait_until(is_there, "the rates")
    # with the signs of the motors; efforts and rates of an update are two messages
    wait_until(lambda: sum(robot.commands["wheel_efforts"].values()) > 0.0, "the efforts")
    found = controller.service.joints.suspension_angles
    assert np.abs(found).max() < 1e-9  # the offset of the rocker's encoder is taken off
    for wheel, angle in zip(WHEEL_JOINTS, aims.angles, strict=True):
        joint = wheel.replace("_wheel", "_steering")
        if joint in robot.angles:
            assert robot.angles[joint] == pytest.approx(angle, abs=1e-9)
    robot.twist.twist.linear.x = robot.twist.twist.angular.z = 0.0
    wait_until(lambda: not any(robot.commands["wheel_velocities"].values()), "the end")
