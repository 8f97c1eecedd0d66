# SPDX-License-Identifier: Apache-2.0
"""The node /mission_planner: queries a traverse_server over ROS 2 for a list of goals.

    mission_planner [--map TERRAIN] --start X,Y,YAW --goal X,Y,YAW [--goal ...]
                    [--drive] [--advise] [--json]

It is a short example of a planner client: it publishes a map, calls `~/can_traverse`, and reads
the verdict, wheel loads and slip ratios that the server publishes with its answer.
"""

import contextlib
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.identity import path_hash, plan_request_hash
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.paths import path_to_poses, poses_path, stamped_pose
from msg_adapters.results.predictions import array_values
from rover_physics.errors import RoverError
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.nodes.mission.drive import Drive, DriveFailedError, DriveSettings
from rover_planner.nodes.programs import MissionOptions, read_arguments
from rover_planner.planning.answering.budget import STOPPING
from rover_planner.ros.process import init_ros
from rover_planner.ros.qos import (
    latched_qos,
    map_qos,
    result_qos,
    sensor_qos,
    service_qos,
    topic_qos,
)
from rover_planner.shell.poses import Pose
from rover_planner.shell.run_program import (
    EXIT_BAD_INPUT,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    EXIT_NO_ANSWER,
    EXIT_NOT_TRAVERSABLE,
    EXIT_OK,
    end_with,
    run_program,
)

NODE_NAME = "mission_planner"
REPEAT = 10.0
"""Time after which a question is asked again: the server may have been started anew [s]."""
SERVER = "traverse_server"
"""Name of the server's node, relative to this node's namespace; remap services and topics to use
another one."""

OWN_OPTIONS = {"policy", "backward"}
"""Options of a remedy that a mission planner can see to: the server's torque policy, and the
direction, which is that of the path. Arm and payload are others' work."""
TEXTS = ("_hash", "_stamp", "server")
"""Ends of keys whose values are texts, even if they look like numbers."""


class NoAnswerError(Exception):
    """The server did not answer in time; the text names the missing answer."""


class MissionPlanner(Node):
    """Queries the server and collects the results that it publishes with each answer.

    The methods below take messages while they wait; nothing else is to spin the node.
    """

    def __init__(self, map_frame: str = "map", timeout: float = 60.0, **node_arguments: Any):
        """Create the client, the map's publisher and the subscriptions to the server's results."""
        super().__init__(NODE_NAME, **node_arguments)
        self._frame = map_frame
        self._timeout = timeout
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self)
        self._verdict: dict[str, Any] = {}
        self._verdict_about: tuple[Any, Any] | None = None
        self._arrays: dict[str, np.ndarray] = {}
        self._pose: np.ndarray | None = None
        self._sent = self._driven = ""
        self._path_publisher: Publisher | None = None
        self._own_paths: set[str] = set()
        self._other_path = False
        self._check_publisher = self.create_publisher(Path, f"{SERVER}/path", topic_qos())
        self._checker = self.create_client(
            Trigger, f"{SERVER}/check_path", qos_profile=service_qos()
        )
        self._adviser = self.create_client(Trigger, f"{SERVER}/advise", qos_profile=service_qos())
        self._parameters = AsyncParameterClient(self, SERVER)
        self.create_subscription(Odometry, "odometry", self._take_odometry, sensor_qos())
        driven = self.create_subscription(String, "path_driven", self._take_driven, latched_qos())
        self._driven_topic = driven.topic_name
        self._map_publisher = self.create_publisher(PointCloud2, "elevation_cloud", map_qos())
        self._client = self.create_client(
            GetPlan, f"{SERVER}/can_traverse", qos_profile=service_qos()
        )
        verdicts = self.create_subscription(
            DiagnosticArray, f"{SERVER}/verdict", self._take_verdict, result_qos()
        )
        self._verdicts = verdicts.topic_name  # as remapped, which count_publishers does not do
        for name in ("wheel_loads", "slip_ratios"):
            take = partial(self._take_array, name)
            self.create_subscription(Float64MultiArray, f"{SERVER}/{name}", take, result_qos())

    def wait_for_server(self) -> None:
        """Wait until the server's service and its verdict topic are connected.

        Raises:
            NoAnswerError: The server is not available in time.
        """
        self._wait(
            lambda: self._client.service_is_ready() and self.count_publishers(self._verdicts) > 0,
            f"the service {self._client.service_name} and the topic {self._verdicts}",
        )

    def publish_map(self, terrain: Terrain) -> None:
        """Publish a terrain for the server and for later subscribers.

        Raises:
            NoAnswerError: No node subscribes to the map in time.
        """
        self._wait(lambda: self._map_publisher.get_subscription_count() > 0, "a map subscriber")
        stamp = self.get_clock().now().to_msg()
        self._map_publisher.publish(terrain_to_point_cloud(terrain, self._frame, stamp))

    def ask(self, start: Sequence[float], goal: Sequence[float]) -> dict[str, Any]:
        """Ask the server whether the rover can drive from start to goal.

        Args:
            start: x, y [m] and yaw [rad] in the map frame.
            goal: x, y [m] and yaw [rad] in the map frame.

        Returns:
            The server's verdict by key, plus `plan` [[x, y, z], ...] [m], its `poses`
            [[x, y, yaw], ...] [m, rad], `max_wheel_load` [N] and `max_slip_ratio` of the judged
            path, None if no path was judged.

        Raises:
            NoAnswerError: The server does not answer in time.
        """
        deadline = time.monotonic() + self._timeout
        while True:
            try:
                answer = self._ask_once(start, goal)
                # the map may arrive later than the query, because it is sent on a topic
                if answer.get("code") not in ("no_map", STOPPING) or time.monotonic() > deadline:
                    return answer
            except NoAnswerError:
                if time.monotonic() > deadline:
                    raise
            time.sleep(0.2)

    def _ask_once(self, start: Sequence[float], goal: Sequence[float]) -> dict[str, Any]:
        self._arrays.clear()
        request = GetPlan.Request()
        request.start = stamped_pose(start, self._frame)
        request.goal = stamped_pose(goal, self._frame)
        answered = self._client.call_async(request)
        plan = self._finish(answered, f"the answer of {self._client.service_name}", REPEAT).plan
        # The hash tells this question from those of other clients, the stamp from earlier ones.
        about = plan.header.stamp, plan_request_hash(request.start, request.goal, 0.0)
        self._wait(
            lambda: self._verdict_about == about, f"the verdict on {self._verdicts}", REPEAT
        )
        answer = dict(self._verdict)
        positions = [pose.pose.position for pose in plan.poses]
        answer["plan"] = [[p.x, p.y, p.z] for p in positions]
        answer["poses"] = path_to_poses(plan, self._frame).tolist() if plan.poses else []
        answer["max_wheel_load"] = self._largest("wheel_loads", answer)
        answer["max_slip_ratio"] = self._largest("slip_ratios", answer)
        return answer

    def send_path(self, poses: np.ndarray) -> None:
        """Let the rover follow a path of poses (n, 3), x, y [m] and yaw [rad], map frame.

        Raises:
            NoAnswerError: Another node sends paths, or none subscribes to them, for all the time.
        """
        publisher = self._path_publisher or self._take_rover()
        # One of those who hear it is this node.
        self._wait(lambda: publisher.get_subscription_count() > 1, "a rover on the topic path")
        path = poses_path(poses, self._frame)
        self._sent, self._driven = path_hash(path), ""
        self._own_paths.add(self._sent)
        publisher.publish(path)

    def _take_rover(self) -> Publisher:
        """Return the publisher of paths, once no other node publishes any.

        Raises:
            NoAnswerError: Another node goes on to publish them.
        """
        topic = self.resolve_topic_name("path")
        others = [one.node_name for one in self.get_publishers_info_by_topic(topic)]
        if others:
            self.get_logger().warning(f"waiting: {', '.join(others)} sends the rover paths")
        self._wait(
            lambda: not self.count_publishers(topic),
            f"the end of {', '.join(others)}, which sends the rover paths",
        )
        self.create_subscription(Path, "path", self._hear_path, topic_qos())
        self._path_publisher = self.create_publisher(Path, "path", topic_qos())
        return self._path_publisher

    def _hear_path(self, path: Path) -> None:
        self._other_path |= path_hash(path) not in self._own_paths

    def has_ended(self) -> bool | None:
        """Return whether the follower is at the end of the path; None if it never says so."""
        if not self.count_publishers(self._driven_topic):
            return None
        return self._driven == self._sent

    def check(self, poses: np.ndarray) -> tuple[str, str]:
        """Return code and reason why the server refuses a path (n, 3) now, empty if it passes.

        Raises:
            NoAnswerError: The server does not answer in time.
        """
        path = poses_path(poses, self._frame)
        about, deadline = path_hash(path), time.monotonic() + self._timeout
        while time.monotonic() < deadline:
            self._check_publisher.publish(path)
            try:
                checked = self._checker.call_async(Trigger.Request())
                answer = json.loads(self._finish(checked, "the answer", REPEAT).message)
            except NoAnswerError:
                continue
            if answer["path_hash"] == about:  # else it was an earlier one, or another client's
                return ("", "") if answer["traversable"] else (answer["code"], answer["reason"])
        raise NoAnswerError(
            f"waited {self._timeout:.0f} s in vain for {self._checker.service_name}"
        )

    def ask_advice(self) -> dict[str, Any]:
        """Return the server's advice on the path that it refused last; see docs/advice.md.

        Raises:
            NoAnswerError: The server does not answer in time.
        """
        advised = self._adviser.call_async(Trigger.Request())
        response = self._finish(advised, f"the answer of {self._adviser.service_name}")
        advice: dict[str, Any] = json.loads(response.message)
        return advice

    def set_policy(self, policy: str) -> None:
        """Let the server judge by another torque policy from now on.

        Raises:
            NoAnswerError: The server does not answer in time.
        """
        changed = self._parameters.set_parameters([Parameter("policy", value=policy)])
        self._finish(changed, f"parameter policy of {SERVER}")

    def wait_for_pose(self, is_wanted: Callable[[np.ndarray], bool], seconds: float) -> np.ndarray:
        """Return the first measured pose (3,) that is wanted, or the last one after some seconds.

        Raises:
            NoAnswerError: No pose was measured in time.
            DriveFailedError: Another node has sent the rover a path.
        """
        if self._other_path:
            raise DriveFailedError("another node has sent the rover a path, and drives it now")
        self._wait(lambda: self._pose is not None, "odometry")
        with contextlib.suppress(NoAnswerError):
            self._wait(lambda: is_wanted(np.array(self._pose)), "the rover", seconds)
        return np.array(self._pose)

    def _take_odometry(self, odometry: Odometry) -> None:
        try:
            pose, _ = odometry_to_pose(odometry, self._frame)
        except MessageError as error:
            self.get_logger().warning(f"odometry not used: {error}", once=True)
            return
        self._pose = pose[[0, 1, 5]]

    def _take_driven(self, message: String) -> None:
        self._driven = message.data

    def _largest(self, name: str, answer: dict[str, Any]) -> float | None:
        """Return the largest value of an array published with the verdict, None if it is empty."""
        rows = answer.get("predicted_waypoints")
        if not rows:
            return None
        self._wait(lambda: len(self._arrays.get(name, ())) == rows, f"{SERVER}/{name}")
        values = self._arrays[name]
        return float(np.nanmax(values)) if np.isfinite(values).any() else None

    def _take_verdict(self, message: DiagnosticArray) -> None:
        verdict = {entry.key: _value(entry) for entry in message.status[0].values}
        self._verdict = verdict
        self._verdict_about = message.header.stamp, verdict.get("question_hash")

    def _take_array(self, name: str, message: Float64MultiArray) -> None:
        self._arrays[name] = array_values(message)

    def _finish(self, future: Any, what: str, timeout: float | None = None) -> Any:
        """Return the response of a call; raises as `_wait`."""
        self._wait(future.done, what, timeout)
        return future.result()

    def _wait(
        self, condition: Callable[[], bool], what: str, timeout: float | None = None
    ) -> None:
        """Take what has come, and what comes until a condition holds.

        Raises:
            NoAnswerError: It does not hold in time.
            ExternalShutdownException: ROS is shut down meanwhile.
        """
        longest = min(timeout or self._timeout, self._timeout)
        deadline = time.monotonic() + longest
        while self._take_next(0.0):
            pass
        while not condition():
            if time.monotonic() > deadline:
                raise NoAnswerError(f"waited {longest:.0f} s in vain for {what}")
            self._take_next(0.1)

    def _take_next(self, seconds: float) -> bool:
        """Take what comes next within some seconds; return whether anything came."""
        try:
            call, _, _ = self._executor.wait_for_ready_callbacks(timeout_sec=seconds)
        except TimeoutException:
            return False
        except Exception:
            if self.context.ok():
                raise
            raise ExternalShutdownException from None  # while it began to wait
        call()
        call.result()  # raises the error of a callback
        return True


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node and return its exit code; see `rover_planner.nodes.programs`."""
    return run_program(NODE_NAME, lambda: _run(argv))


def _run(argv: Sequence[str] | None) -> int:
    try:
        options = read_arguments(NODE_NAME, argv)
        if options == EXIT_OK:  # help was printed
            return EXIT_OK
        terrain = load_terrain(options.map_name) if options.map_name else None
    except RoverError as error:
        return end_with(NODE_NAME, EXIT_BAD_INPUT, str(error))
    init_ros(argv)
    node = MissionPlanner(options.map_frame, options.timeout)
    try:
        return _carry_out(node, terrain, options)
    except NoAnswerError as error:
        return end_with(NODE_NAME, EXIT_NO_ANSWER, str(error))
    except DriveFailedError as error:
        return end_with(NODE_NAME, EXIT_FAILED, str(error))
    except (KeyboardInterrupt, ExternalShutdownException):
        return EXIT_INTERRUPTED
    finally:
        rclpy.try_shutdown()
        node.destroy_node()


def _carry_out(node: MissionPlanner, terrain: Terrain | None, options: MissionOptions) -> int:
    """Publish the map and query each goal; return the exit code."""
    report = _print_json if options.as_json else _print_text
    report({"event": "waiting for the server"})
    node.wait_for_server()
    if terrain is not None:
        report({"event": "publishing the map"})
        node.publish_map(terrain)
    codes: set[int] = set()
    start: Sequence[float] = options.start
    for number, goal in enumerate(options.goal, start=1):

        def tell(text: str, goal: int = number) -> None:
            report({"event": text, "goal": goal})

        tell("asking")
        asked = time.monotonic()
        answer = node.ask(start, goal)
        answer["response_time"] = time.monotonic() - asked
        report({"event": "answer", "goal": number, "answer": answer})
        if options.advise and _was_judged(answer) and not answer["traversable"]:
            advised = _take_advice(node, start, goal, tell)
            if advised is not None:
                answer = advised
                report({"event": "answer", "goal": number, "answer": answer})
        codes.add(_exit_code(answer))
        if options.drive and answer["traversable"]:
            tell("driving")
            try:
                settings = DriveSettings(options.position_tolerance, options.heading_tolerance)
                start = Drive(node, goal, settings, tell).run(answer["poses"]).tolist()
            except NoAnswerError as error:
                raise DriveFailedError(str(error)) from error
            tell("arrived")
    return next(code for code in (EXIT_FAILED, EXIT_NOT_TRAVERSABLE, EXIT_OK) if code in codes)


def _take_advice(
    node: MissionPlanner, start: Sequence[float], goal: Pose, tell: Callable[[str], None]
) -> dict[str, Any] | None:
    """Take the first remedy that needs nobody else; return the answer with it, None without."""
    advice = node.ask_advice()
    remedy = choose_remedy(advice)
    if remedy is None:
        words = advice.get("words", advice["reason"])
        tell(f"advice: none that a mission planner can take; {words}")
        return None
    tell(f"advice: {remedy['words']}")
    if "policy" in remedy["options"]:
        node.set_policy(remedy["options"]["policy"])
    if "poses" not in remedy:
        return node.ask(start, goal)
    poses = remedy["poses"]
    _, reason = node.check(np.array(poses))
    return {"traversable": not reason, "reason": reason, "poses": poses, "waypoints": len(poses)}


def _was_judged(answer: dict[str, Any]) -> bool:
    """Return whether a path was judged; otherwise the query was refused."""
    return "waypoints" in answer


def _exit_code(answer: dict[str, Any]) -> int:
    """Return the exit code of one answer."""
    if answer["traversable"]:
        return EXIT_OK
    return EXIT_NOT_TRAVERSABLE if _was_judged(answer) else EXIT_FAILED


def _print_json(event: dict[str, Any]) -> None:
    print(json.dumps(event), flush=True)


def _print_text(event: dict[str, Any]) -> None:
    if event["event"] == "answer":
        answer = event["answer"]
        no = "no" if _was_judged(answer) else "not judged"
        word = "yes" if answer["traversable"] else f"{no}, {answer['reason']}"
        print(f"goal {event['goal']}: {word}", flush=True)
    elif event["event"] != "asking":
        print(event["event"], flush=True)


def _value(entry: KeyValue) -> Any:
    """Parse a value of a diagnostic status as JSON; other texts are returned as they are."""
    if entry.key.endswith(TEXTS):
        return entry.value
    try:
        return json.loads(entry.value)
    except ValueError:
        return entry.value


def choose_remedy(advice: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the first remedy of ~/advise that needs nobody else, None if there is none."""
    for remedy in advice["remedies"]:
        if not remedy["needs_others"] and set(remedy["options"]) <= OWN_OPTIONS:
            return dict(remedy)
    return None


if __name__ == "__main__":
    sys.exit(main())
