# SPDX-License-Identifier: Apache-2.0
"""A rover that is driven by a controller, for the tests of this folder."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float64MultiArray, String

from msg_adapters.stamps import ns_to_stamp
from rover_physics.names import WHEEL_JOINTS
from rover_planner.nodes.traction_controller import NODE_NAME, TractionController
from rover_planner.nodes.warm_up import JOINTS
from rover_planner.ros.node import create_steady_timer
from rover_planner.ros.qos import SENSOR_QOS
from support.ros_fixtures import PATIENT, hear
from support.waiting import wait_until

RATE = 50.0
"""Messages per second of each sensor."""
QUEUE = 1000
"""Messages that wait for a listener that is late; none is lost."""


class DrivenRover(Node):
    """A rover whose wheels turn at a constant rate, whatever the torques are."""

    def __init__(self, context: Context):
        """Send at RATE [Hz] from now on; stamps are zero until `stamp` is replaced."""
        super().__init__("rover", context=context)
        self.joints = JointState(name=list(JOINTS))
        self.joints.position = [0.0] * len(JOINTS)
        self.joints.velocity = [0.2 if name in WHEEL_JOINTS else 0.0 for name in JOINTS]
        self.imu = Imu()
        self.twist: TwistStamped | Twist = TwistStamped()
        self.stamp: Callable[[], int] = lambda: 0
        """Returns a header stamp [ns]."""
        self.commands: list[tuple[int, float, float]] = []
        """Time at which each was sent [ns], largest magnitude and sum of its torques [N m]."""
        self._sent_at = 0
        self._senders = {
            "joint_states": self.create_publisher(JointState, "joint_states", SENSOR_QOS),
            "imu": self.create_publisher(Imu, "imu", SENSOR_QOS),
        }
        queue = QoSProfile(depth=QUEUE)
        latched = QoSProfile(depth=QUEUE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(
            Float64MultiArray, f"{NODE_NAME}/commands", self._hear_command, queue
        )
        self._states = hear(self, String, f"{NODE_NAME}/state", latched)
        self._brakes = hear(self, Bool, f"{NODE_NAME}/brake", latched)
        self._diagnostics = hear(self, DiagnosticArray, "diagnostics", queue)
        self._log = hear(self, Log, "/rosout", latched)
        create_steady_timer(self, 1.0 / RATE, self._send)

    def send_twists(self, kind: type = TwistStamped) -> None:
        """Send cmd_vel of a type from now on."""
        self.twist = kind()
        self._senders["cmd_vel"] = self.create_publisher(kind, "cmd_vel", SENSOR_QOS)

    def _send(self) -> None:
        self._sent_at = time.time_ns()
        now = ns_to_stamp(self.stamp())
        self.joints.header.stamp = self.imu.header.stamp = now
        twist = self.twist
        if isinstance(twist, TwistStamped):
            twist.header.stamp, twist = now, twist.twist
        twist.linear.x = 0.03
        messages = {"joint_states": self.joints, "imu": self.imu, "cmd_vel": self.twist}
        for name, sender in self._senders.items():
            sender.publish(messages[name])

    def _hear_command(self, message: Float64MultiArray, info: dict[str, int]) -> None:
        torques = list(message.data)
        sent = info["source_timestamp"]
        self.commands.append((sent, max(map(abs, torques)), sum(torques)))

    @property
    def state(self) -> str:
        """The last state of the controller."""
        return self._states[-1].data if self._states else ""

    @property
    def brakes(self) -> list[bool]:
        """The states of its brake."""
        return [brake.data for brake in self._brakes]

    @property
    def status(self) -> Any:
        """Its last status on diagnostics."""
        told = [one for message in self._diagnostics for one in message.status]
        mine = [one for one in told if one.name.startswith(NODE_NAME)]
        return mine[-1] if mine else DiagnosticStatus()

    @property
    def log(self) -> list[str]:
        """The lines of its log."""
        return [line.msg for line in self._log if NODE_NAME in line.name]

    @property
    def values(self) -> dict[str, str]:
        """The values of the controller's last status by key."""
        return {entry.key: entry.value for entry in self.status.values}

    @property
    def torque(self) -> float:
        """The largest torque of the last command [N m]; 0 if there is none."""
        return self.commands[-1][1] if self.commands else 0.0

    @property
    def push(self) -> float:
        """The sum of the torques of the last command [N m]; 0 if there is none."""
        return self.commands[-1][2] if self.commands else 0.0

    def commands_after(self, stamp: int) -> list[tuple[int, float]]:
        """Return time [ns] and sum of torques of the commands that were sent after a time [ns]."""
        return [(at, push) for at, _, push in self.commands if at > stamp]

    def wait_for_send(self) -> int:
        """Return when the first message was sent of those that are sent from now on [ns]."""
        now = time.time_ns()
        return wait_until(lambda: self._sent_at if self._sent_at > now else 0, "a message")

    def wait_until_driven(self) -> None:
        """Wait until the controller drives and the wheels push."""
        wait_until(lambda: self.state == "driving" and self.push > 0.0, "driving")

    def count_lines(self, text: str) -> int:
        """Return how many lines of the controller's log have a text."""
        return sum(text in line for line in self.log)


@pytest.fixture
def start_rover(ros):
    """Return a function that starts a rover, which sends cmd_vel of a type, None: none at all."""

    def start(run=ros, kind=TwistStamped):
        rover = DrivenRover(run.context)
        if kind is not None:
            rover.send_twists(kind)
        return run.spin(rover)

    return start


@pytest.fixture
def rover(start_rover):
    """Return a rover that sends everything that a controller needs."""
    return start_rover()


@pytest.fixture
def start_controller(ros):
    """Return a function that starts an enabled, patient controller with other parameters."""

    def start(**values):
        given = {"rate": RATE, "enabled_at_start": True, **PATIENT} | values
        return ros.start(TractionController, **given)

    return start


@pytest.fixture
def controller(rover, start_controller):
    """Return a patient controller that drives the rover."""
    node = start_controller()
    rover.wait_until_driven()
    return node
