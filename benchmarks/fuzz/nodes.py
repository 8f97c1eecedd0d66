"""Runs the nodes that are fuzzed, and talks to them: bytes out, answers and commands back."""

import math
import os
import threading
import time
from pathlib import Path as FilePath
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan, LoadMap
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState, PointCloud2
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.terrain.grid import save_terrain
from rover_planner.demo.child_process import ChildProcess
from rover_planner.parameters.table import specs_of
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.qos import map_qos, topic_qos

SERVER, CONTROLLER = "traverse_server", "traction_controller"
START_TIME = 180.0
"""Longest wait for a node to start [s]; it may compile kernels."""
TOPICS = {
    "cloud": (PointCloud2, "elevation_cloud"),
    "joint_states": (JointState, "joint_states"),
    "imu": (Imu, "imu"),
    "odometry": (Odometry, "odometry"),
    "cmd_vel": (TwistStamped, "cmd_vel"),
    "path": (Path, f"{SERVER}/path"),
    "tool_target": (PoseStamped, f"{SERVER}/tool_target"),
    "tool_wrench": (WrenchStamped, f"{SERVER}/tool_wrench"),
}
"""Type and name of the topics, by kind of message."""
SERVICES = {
    "plan": (GetPlan, f"{SERVER}/can_traverse"),
    "load_map": (LoadMap, f"{SERVER}/load_map"),
    "parameters": (SetParameters, f"{SERVER}/set_parameters"),
    "check_path": (Trigger, f"{SERVER}/check_path"),
    "check_reach": (Trigger, f"{SERVER}/check_reach"),
}
"""Type and name of the services, by kind of request."""


class NodeProcesses:
    """The fuzzed nodes; a dead one is started again."""

    def __init__(self, folder: FilePath, children: list[ChildProcess], domain: int, ground: Any):
        self._folder, self._children, self._domain = folder, children, domain
        self._count = 0
        file = folder / "ground.npz"
        save_terrain(file, ground)
        self._arguments = {
            SERVER: ["--ros-args", "-p", f"terrain_file:={file}"],
            CONTROLLER: ["--ros-args", "-p", "enabled_at_start:=true"],
        }
        self.running = {name: self.start(name) for name in (SERVER, CONTROLLER)}

    def start(self, name: str) -> ChildProcess:
        """Start a node."""
        self._count += 1
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(self._domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        child = ChildProcess(
            f"rover_planner.nodes.{name}", self._arguments[name], environment,
            self._folder / f"{name}{self._count}.log",
        )  # fmt: skip
        self._children.append(child)
        return child

    def log(self, name: str) -> str:
        """Return what a node has written to stderr."""
        return self.running[name].log.read_text(errors="replace")

    def restart(self, name: str) -> None:
        """End a node, if it still runs, and start it again."""
        self.running[name].stop()
        self.running[name] = self.start(name)


class FuzzClient:
    """Publishes messages and bytes, calls services, and watches the commands."""

    def __init__(self, node: Node):
        self._node = node
        self._publishers = {
            kind: node.create_publisher(*topic, map_qos() if kind == "cloud" else topic_qos())
            for kind, topic in TOPICS.items()
        }
        self._clients = {kind: node.create_client(*service) for kind, service in SERVICES.items()}
        self.commands = 0
        """Number of commands that came."""
        self.worst_torque = 0.0
        """Largest commanded torque [N m]; NaN if one was no number."""
        node.create_subscription(
            Float64MultiArray, f"{CONTROLLER}/commands", self._take_command, topic_qos()
        )

    def publish(self, kind: str, message: Any) -> None:
        """Publish a message or serialised bytes."""
        self._publishers[kind].publish(message)

    def call(self, kind: str, request: Any, timeout: float) -> Any:
        """Return the response of a service, None if there is none within the timeout [s]."""
        done = threading.Event()
        future = self._clients[kind].call_async(request)
        future.add_done_callback(lambda _: done.set())
        if not done.wait(timeout):
            self._clients[kind].remove_pending_request(future)
            return None
        return future.result()

    def wait_for_nodes(self) -> None:
        """Wait until both nodes have started and are connected."""
        end = time.monotonic() + START_TIME
        publishers, clients = self._publishers.values(), self._clients.values()
        while time.monotonic() < end:
            connected = all(publisher.get_subscription_count() for publisher in publishers)
            if connected and all(client.service_is_ready() for client in clients):
                return
            time.sleep(0.1)
        raise TimeoutError(f"the nodes did not start within {START_TIME:.0f} s")

    def feed_controller(self, seconds: float) -> int:
        """Publish good inputs of the controller; return the number of commands meanwhile."""
        before, end = self.commands, time.monotonic() + seconds
        while time.monotonic() < end:
            for kind, message in self._good_inputs().items():
                self.publish(kind, message)
            time.sleep(0.01)
        return self.commands - before

    def reset_parameters(self, timeout: float) -> bool:
        """Set the server's parameters to their defaults; return whether it answered."""
        changes = [
            Parameter(spec.name, value=spec.ros_default).to_parameter_msg()
            for spec in specs_of(TraverseServerParameters)
            if not spec.read_only
        ]
        request = SetParameters.Request(parameters=changes)
        response = self.call("parameters", request, timeout)
        return response is not None and all(result.successful for result in response.results)

    def _good_inputs(self) -> dict[str, Any]:
        now = self._node.get_clock().now().to_msg()
        names = [*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS]
        zeros = [0.0] * len(names)
        imu, twist = Imu(), TwistStamped()
        joints = JointState(name=names, position=zeros, velocity=zeros)
        imu.orientation.w, imu.header.frame_id = 1.0, "base_link"
        twist.twist.linear.x = 0.02
        messages = {"joint_states": joints, "imu": imu, "cmd_vel": twist}
        for message in messages.values():
            message.header.stamp = now
        return messages

    def _take_command(self, command: Float64MultiArray) -> None:
        self.commands += 1
        for torque in command.data:
            if not abs(torque) <= self.worst_torque:
                self.worst_torque = abs(torque) if math.isfinite(torque) else math.nan


def serialise(message: Any) -> bytes:
    """Return the bytes of a message as they go over the wire."""
    return bytes(serialize_message(message))
