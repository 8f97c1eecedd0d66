# SPDX-License-Identifier: Apache-2.0
"""Throws hostile messages, requests and damaged bytes over DDS at running nodes: `make fuzz`.

Run from the repository: python -m benchmarks.fuzz [--seed N] [--count N]

Good messages get up to three faults: numbers, names and lengths that nobody expects. After each
batch both nodes must live, the server must give the same answer to a known question, and the
controller must send commands within its limit. The exit code is 1 if there was a defect.
"""

import array
import math
import re
import time
from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer
from geometry_msgs.msg import TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan, LoadMap
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from benchmarks.measure import print_table
from benchmarks.processes import (
    CONTROLLER,
    SERVER,
    START_TIME,
    LostAnswerError,
    NodeProcesses,
    finish,
    memory_of,
    open_nodes,
    plan_request,
)
from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.paths import poses_path, stamped_pose
from rover_physics import Terrain
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_planner.parameters.table import specs_of
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.ros.qos import map_qos, topic_qos
from support.waiting import wait_until

ODD_NUMBERS = (
    0.0, -0.0, 5e-324, 1e-310, 1e-154, 1e-9, 1e-3, 1.0, -1.0, 3.15, 1e6, 4.6e6, -1e9, 1.1e9, 1e19,
    3.4e38, 1e154, -1e200, 1.79e308, math.inf, -math.inf, math.nan,
)  # fmt: skip
WHOLE = (0, 1, 2, 3, 7, 12, 255, 65_536, 2**31 - 1, -(2**31), -1, 2**32 - 1, 2**63 - 1)
NAMES = (
    "", "map", "odom", "x", "z", "friction", "rocker_left", "\n", "\x1b[2J", "é", "n" * 100_000,
    "//[", "http://[bad", "file://", "file://[::1", "/dev/zero", "/proc/self/mem", "/etc/passwd",
    "spirit", "u" * 5_000, "../" * 50, "a%00b", "file:///%ff%fe", "~", "/proc/self/fd/0", "mean",
    *(spec.name for spec in specs_of(TraverseServerParameters)),
)  # fmt: skip
MOST_FAULTS = 3
DAMAGED_SHARE = 0.25
"""Share of messages whose serialised bytes are damaged."""
START, GOAL = (-1.0, 0.0, 0.0), (1.0, 0.1, 0.0)
BATCH = 50
"""Inputs between two probes."""
PROBE_TIME, ANSWER_TIME = 2.0, 8.0
"""Longest wait for the answer to a probe, and to a hostile request [s]."""
PAUSE = 0.002
"""Time between two inputs [s]."""
MAX_GROWTH = 600.0
"""Largest growth of a node's memory [MB]."""
MAX_TORQUE = 2.0
"""Largest torque of a wheel of LSR-1 [N m]."""
STAMP = re.compile(r"^\[(\w+)\] \[[\d.]+\]")


def good_ground() -> Terrain:
    """Return gentle waves that end at an edge, over which a rover cannot drive back."""
    along = 0.05 * np.arange(121) - 3.0
    heights = 0.02 * np.sin(2.0 * along)[:, None] - np.where(along < 1.5, 0.0, 0.09)
    friction = np.tile(np.where(along < 1.5, 0.8, 0.4), (len(along), 1))
    return Terrain(heights, 0.05, (-3.0, -3.0), friction=friction)


def good_joints() -> JointState:
    """Return joint states of a rover that rests."""
    names = [*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS]
    return JointState(name=names, position=[0.0] * len(names), velocity=[0.0] * len(names))


def good_imu() -> Imu:
    """Return the attitude of a level rover."""
    imu = Imu()
    imu.orientation.w, imu.header.frame_id = 1.0, "base_link"
    return imu


def good_odometry() -> Odometry:
    """Return odometry at the origin."""
    odometry = Odometry(child_frame_id="base_link")
    odometry.header.frame_id, odometry.pose.pose.orientation.w = "map", 1.0
    return odometry


def good_twist() -> TwistStamped:
    """Return a command to creep ahead."""
    twist = TwistStamped()
    twist.twist.linear.x = 0.02
    return twist


def good_wrench() -> WrenchStamped:
    """Return a push of the tool."""
    wrench = WrenchStamped()
    wrench.header.frame_id, wrench.wrench.force.z = "map", 5.0
    return wrench


def good_parameters() -> SetParameters.Request:
    """Return a change of two parameters."""
    changes = [Parameter("friction", value=0.7), Parameter("policy", value="optimal")]
    return SetParameters.Request(parameters=[change.to_parameter_msg() for change in changes])


MESSAGES: dict[str, Callable[[], Any]] = {
    "elevation_cloud": lambda: terrain_to_point_cloud(good_ground(), "map"),
    "joint_states": good_joints,
    "imu": good_imu,
    "odometry": good_odometry,
    "cmd_vel": good_twist,
    f"{SERVER}/path": lambda: poses_path(np.linspace(START, GOAL, 20), "map"),
    f"{SERVER}/tool_target": lambda: stamped_pose((0.5, 0.0, 0.0), "map"),
    f"{SERVER}/tool_wrench": good_wrench,
}
"""A good message for each topic."""
REQUESTS: dict[str, tuple[type, Callable[[], Any]]] = {
    "can_traverse": (GetPlan, lambda: plan_request(START, GOAL)),
    "load_map": (LoadMap, lambda: LoadMap.Request(map_url="spirit")),
    "set_parameters": (SetParameters, good_parameters),
    "check_path": (Trigger, Trigger.Request),
    "check_reach": (Trigger, Trigger.Request),
}
"""Type of each service of the server, and a good request."""


def serialise(message: Any) -> bytes:
    """Return the bytes of a message as they go over the wire."""
    return bytes(serialize_message(message))


class Mutator:
    """Damages messages, in the same way for the same seed."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)

    def pick(self, choices: Any) -> Any:
        """Return one of some choices."""
        return choices[int(self.rng.integers(len(choices)))]

    def damage(self, message: Any) -> Any:
        """Return a message with up to MOST_FAULTS hostile fields, however deep they are."""
        faults = self.rng.integers(MOST_FAULTS + 1) if message.get_fields_and_field_types() else 0
        for _ in range(int(faults)):
            owner, name = self._choose_field(message)
            kind = owner.get_fields_and_field_types()[name]
            setattr(owner, name, self._spoil(getattr(owner, name), kind))
        return message

    def damage_bytes(self, data: bytes) -> bytes:
        """Return serialised bytes that are cut, extended, replaced or changed in some places."""
        changed = bytearray(data)
        for at in self.rng.integers(0, len(data), self.rng.integers(1, 9)):
            changed[at] = int(self.rng.integers(256))
        cut = data[: int(self.rng.integers(len(data) + 1))]
        random = data[:4] + self.rng.bytes(max(len(data) - 4, 1))
        return self.pick((cut, data + self.rng.bytes(40), random, bytes(changed)))

    def _choose_field(self, message: Any) -> tuple[Any, str]:
        """Return a message within a message, or itself, and the name of a field with no others."""
        name = self.pick(list(message.get_fields_and_field_types()))
        value = getattr(message, name)
        if isinstance(value, list) and value and self.rng.random() < 0.7:
            value = self.pick(value)
        if hasattr(value, "get_fields_and_field_types") and value.get_fields_and_field_types():
            return self._choose_field(value)
        return message, name

    def _spoil(self, value: Any, kind: str) -> Any:
        """Return another value of a field of a type, such as uint8."""
        if isinstance(value, bool):
            return not value
        if isinstance(value, str):
            return self.pick(NAMES)
        if isinstance(value, int):
            bits = 8 if kind in ("byte", "octet", "char") else int(kind.removeprefix("u")[3:])
            low = 0 if kind[0] in "ubo" else -(2 ** (bits - 1))
            return self.pick([one for one in WHOLE if low <= one < low + 2**bits])
        if isinstance(value, float):
            return self.pick(ODD_NUMBERS)
        if isinstance(value, list) and value:
            odd = [*value[1:], self.pick(NAMES) if isinstance(value[0], str) else value[0]]
            return self.pick((value[: len(value) // 2], value + value[:1], value[::-1], odd))
        if isinstance(value, array.array | np.ndarray) and len(value):
            return self._spoil_array(value)
        return value

    def _spoil_array(self, value: Any) -> Any:
        """Return an array that is cut, or has a number that nobody expects."""
        if isinstance(value, array.array) and self.rng.random() < 0.3:
            return value[: int(self.rng.integers(len(value)))]
        changed = np.array(value)
        kind = "<f4" if changed.dtype == np.uint8 else changed.dtype  # bytes of points, mostly
        numbers = changed[: len(changed) // 4 * 4].view(kind)
        with np.errstate(all="ignore"):
            numbers[self.rng.integers(len(numbers), size=self.pick((1, 3, len(numbers))))] = (
                self.pick(ODD_NUMBERS)
            )
        if isinstance(value, np.ndarray):
            return changed
        return array.array(value.typecode, changed.tobytes())


class Fuzzer:
    """Throws batches of inputs at both nodes and probes them after each."""

    def __init__(self, nodes: NodeProcesses, seed: int):
        self._mutator, self._nodes = Mutator(seed), nodes
        self.counts: Counter[str] = Counter()
        """Inputs by kind."""
        self.slowest: dict[str, float] = {}
        """Longest time for one input [s], by kind."""
        self.defects: list[str] = []
        """Found defects: deaths, hangs, internal errors, lost maps, memory."""
        self.commands, self.worst_torque = 0, 0.0
        """Number of commands that came, and largest commanded torque [N m]."""
        self._start = {
            SERVER: {"terrain_file": good_ground()},
            CONTROLLER: {"enabled_at_start": True},
        }
        self._running = {name: nodes.start(name, **words) for name, words in self._start.items()}
        self._client = nodes.client("fuzzer")
        node = self._client.node
        qos = {"elevation_cloud": map_qos()}
        self._publishers = {
            topic: node.create_publisher(type(make()), topic, qos.get(topic, topic_qos()))
            for topic, make in MESSAGES.items()
        }
        self._services = {
            name: node.create_client(kind, f"{SERVER}/{name}")
            for name, (kind, _) in REQUESTS.items()
        }
        node.create_subscription(
            Float64MultiArray, f"{CONTROLLER}/commands", self._hear_command, topic_qos()
        )
        self._wait_for_nodes()
        self._feed_controller(0.5)
        self._plan = self._ask(ANSWER_TIME)
        self._memory = {name: memory_of(child) for name, child in self._running.items()}

    def run(self, count: int) -> None:
        """Throw a number of inputs."""
        kinds = [*MESSAGES, *REQUESTS]
        for first in range(0, count, BATCH):
            for _ in range(min(BATCH, count - first)):
                kind, began = self._mutator.pick(kinds), time.perf_counter()
                (self._publish if kind in MESSAGES else self._request)(kind)
                taken = time.perf_counter() - began
                self.counts[kind] += 1
                self.slowest[kind] = max(self.slowest.get(kind, 0.0), taken)
                time.sleep(PAUSE)
            self._probe(f"inputs from {first}")
        if not self.worst_torque <= MAX_TORQUE:
            self.defects.append(f"a torque of {self.worst_torque} N m was commanded")
        for name, child in self._running.items():
            growth = memory_of(child) - self._memory[name]
            print(f"{name}: memory grew by {growth:.0f} MB")
            if growth > MAX_GROWTH:
                self.defects.append(f"{name} grew by more than {MAX_GROWTH:.0f} MB")
            for line in child.log.read_text(errors="replace").splitlines():
                if "internal error" in line or "Warning:" in line:
                    self.defects.append(f"{name}: {STAMP.sub('', line)[:300]}")

    def _publish(self, topic: str) -> None:
        message = self._mutator.damage(MESSAGES[topic]())
        if self._mutator.rng.random() < DAMAGED_SHARE:
            message = self._mutator.damage_bytes(serialise(message))
        self._publishers[topic].publish(message)

    def _request(self, name: str) -> None:
        if self._call(name, self._mutator.damage(REQUESTS[name][1]()), ANSWER_TIME) is None:
            self.defects.append(f"{name}: no answer within {ANSWER_TIME:.0f} s")

    def _call(self, name: str, request: Any, timeout: float) -> Any:
        """Return the response of a service, None if there is none within the timeout [s]."""
        future = self._services[name].call_async(request)
        try:
            return finish(future, timeout)
        except LostAnswerError:
            self._services[name].remove_pending_request(future)
            return None

    def _probe(self, where: str) -> None:
        """Check that both nodes live, answer and keep a good map."""
        for name, child in self._running.items():
            if not child.running:
                self.defects.append(f"{where}: {name} died: {child.last_line()[:200]}")
                self._running[name] = self._nodes.start(name, **self._start[name])
                self._wait_for_nodes()
        if not self._reset_parameters():
            self.defects.append(f"{where}: parameters were not set back")
        self._publishers["elevation_cloud"].publish(MESSAGES["elevation_cloud"]())
        self._publishers["joint_states"].publish(good_joints())
        end, answer = time.monotonic() + PROBE_TIME, None
        while answer != self._plan and time.monotonic() < end:
            answer = self._ask(PROBE_TIME)
        if answer != self._plan:
            wrong = "no answer" if answer is None else "another answer to the same question"
            self.defects.append(f"{where}: {SERVER}: {wrong}")
        heard = self.commands
        self._feed_controller(0.3)
        if self.commands == heard:
            self.defects.append(f"{where}: {CONTROLLER} sends no commands")

    def _ask(self, timeout: float) -> list[tuple[float, float]] | None:
        """Return the places of the plan for a known question; None without an answer."""
        response = self._call("can_traverse", plan_request(START, GOAL), timeout)
        if response is None:
            return None
        places = [stamped.pose.position for stamped in response.plan.poses]
        return [(place.x, place.y) for place in places]

    def _reset_parameters(self) -> bool:
        """Set the server's parameters to their defaults; return whether it accepted them."""
        changes = [
            Parameter(spec.name, value=spec.ros_default).to_parameter_msg()
            for spec in specs_of(TraverseServerParameters)
            if not spec.read_only
        ]
        request = SetParameters.Request(parameters=changes)
        response = self._call("set_parameters", request, ANSWER_TIME)
        return response is not None and all(result.successful for result in response.results)

    def _wait_for_nodes(self) -> None:
        """Wait until both nodes have started and are connected."""
        wait_until(
            lambda: (
                all(one.get_subscription_count() for one in self._publishers.values())
                and all(one.service_is_ready() for one in self._services.values())
            ),
            "both nodes",
            START_TIME,
        )

    def _feed_controller(self, seconds: float) -> None:
        """Publish good inputs of the controller for a time [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for topic in ("joint_states", "imu", "cmd_vel"):
                message = MESSAGES[topic]()
                message.header.stamp = self._client.node.get_clock().now().to_msg()
                self._publishers[topic].publish(message)
            time.sleep(0.01)

    def _hear_command(self, command: Float64MultiArray) -> None:
        self.commands += 1
        for torque in command.data:
            if not abs(torque) <= self.worst_torque:
                self.worst_torque = abs(torque) if math.isfinite(torque) else math.nan


def fuzz(seed: int, count: int) -> Fuzzer:
    """Throw inputs at a server and a controller; return what became of them."""
    with open_nodes() as nodes:
        fuzzer = Fuzzer(nodes, seed)
        fuzzer.run(count)
        return fuzzer


def main(
    seed: Annotated[int, typer.Option(help="Seed of the inputs.")] = 1,
    count: Annotated[int, typer.Option(help="Number of inputs.")] = 6000,
) -> None:
    """Throw the inputs and print what became of them."""
    fuzzer = fuzz(seed, count)
    rows = [
        (kind, number, f"{1e3 * fuzzer.slowest[kind]:.1f}")
        for kind, number in sorted(fuzzer.counts.items())
    ]
    most = f"{fuzzer.worst_torque:.2f} N m"
    title = f"{count:,} inputs, {fuzzer.commands:,} commands of at most {most}"
    print_table(title, ("kind", "inputs", "slowest [ms]"), rows)
    print(f"defects: {len(fuzzer.defects)}")
    for text, number in Counter(fuzzer.defects).most_common(50):
        print(f"  {number} x {text}")
    raise typer.Exit(1 if fuzzer.defects else 0)


if __name__ == "__main__":
    typer.run(main)
