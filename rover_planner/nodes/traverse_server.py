# SPDX-License-Identifier: Apache-2.0
"""The node /traverse_server: answers over ROS 2 whether the rover can traverse a path."""

import sys
import time
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry, Path
from nav_msgs.srv import GetPlan
from rclpy.event_handler import SubscriptionEventCallbacks
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

from msg_adapters.errors import MessageError
from msg_adapters.identity import plan_request_hash
from msg_adapters.paths import count_poses
from msg_adapters.results.diagnostics import HEALTH, MONITOR, make_status, to_json
from msg_adapters.stamps import NANOSECONDS
from rover_physics.errors import RoverError
from rover_physics.numerics.kernel_cache import kernel_cache_note
from rover_physics.numerics.plain_values import to_plain
from rover_physics.warm_up import EXACT, UNCERTAIN
from rover_planner.maps.known_map import describe_terrain, stamp_text
from rover_planner.nodes.advice_topics import AdviceTopics
from rover_planner.nodes.arm_topics import ArmTopics
from rover_planner.nodes.map_topics import MapCloud, MapTopics
from rover_planner.nodes.nav2_services import Nav2Services
from rover_planner.nodes.navigation.hazard_topics import HazardTopics
from rover_planner.nodes.navigation.path_watch import MAX_POSE_AGE, PERIOD, PathWatch
from rover_planner.nodes.question_desk import Answer, QuestionDesk
from rover_planner.nodes.result_topics import ResultMessages, ResultTopics
from rover_planner.nodes.running import run_node
from rover_planner.nodes.warm_up import HAZARDS, PATH_SEARCH, load_kernels
from rover_planner.parameters.traverse_server import FAN, TraverseServerParameters
from rover_planner.planning.answering.budget import CANCELLED
from rover_planner.planning.answering.judgement import IdentityReport, PathJudgement
from rover_planner.planning.answering.questions import PathQuestion
from rover_planner.planning.answering.server_health import MEMORY
from rover_planner.planning.answering.service_settings import (
    ServiceSettings,
    load_service_settings,
)
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot
from rover_planner.planning.learned_ground import parse_learned
from rover_planner.planning.marked_places import NONE_MARKED, parse_place
from rover_planner.planning.path_query import Pose
from rover_planner.ros.frames import NodeFrames, is_empty
from rover_planner.ros.map_intake import read_message
from rover_planner.ros.node import RoverNode, create_steady_timer
from rover_planner.ros.qos import (
    NEWEST_QOS,
    RESULT_QOS,
    TOPIC_QOS,
    joints_qos,
    make_qos,
)
from rover_planner.ros.server_inputs import ServerInputs, describe_path
from rover_planner.ros.subscriptions import subscribe_to_requests

NODE_NAME = "traverse_server"
SWITCH_INTERVAL = 1e-3
"""Longest time for which a thread that prepares maps may delay a question whenever it needs
Python's lock [s]; Python's thread switch interval."""
IDLE_PERIOD = 1.0
"""Time between two beats while no path is watched [s]."""
DIAGNOSTICS_PERIOD = 1.0
"""Time between two diagnostic messages [s]."""


class TraverseServer(RoverNode[TraverseServerParameters]):
    """Connects a TraverseService to ROS; nothing that arrives ends the node.

    Questions are answered in a thread and maps are prepared in another one, so that all other
    requests are served meanwhile.
    """

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, TraverseServerParameters, **node_arguments)
        behind = UNCERTAIN if self.values.planner == FAN else (*UNCERTAIN, *PATH_SEARCH)
        behind = (*behind, *HAZARDS) if self.values.hazard_map else behind
        # Other nodes discover this one meanwhile, which may take DDS three seconds.
        self._behind = load_kernels(EXACT, behind, self.get_logger().info)
        self.frames = NodeFrames(self, self.values)
        """Transforms poses to the map frame."""
        self.frames.listen()
        self._inputs = ServerInputs(self.values, self.frames)
        self.service = self._inputs.service
        """The service with the last map, path and joint angles."""
        self._results = ResultTopics(self, self._inputs)
        self._maps = MapTopics(self, self._inputs, self._hear_of_map)
        self.desk = QuestionDesk(self, self.service, self._maps)
        """Takes the questions of all services."""
        self._create_subscriptions()
        self.desk.serve(GetPlan, "can_traverse", self.read_question, self._fill_plan)
        self.desk.serve(Trigger, "check_path", lambda _: self.service.given_path, self._fill_check)
        Nav2Services(self, self.desk, self.read_path, self.read_question, self.publish)
        self._advice = AdviceTopics(self, self.desk)
        self.create_service(Trigger, "~/cancel", self._cancel)
        self.create_service(Trigger, "~/clear_places", self._clear_marks)
        self.arm = ArmTopics(self, self.desk)
        """The topics and the service of the arm."""
        self._map_cloud = MapCloud(self, self.service)
        self.watch = PathWatch(self, self.service, self._find_watched, self._publish_stop)
        """Watches the accepted path."""
        self._hazards = HazardTopics(self, self.service, self.desk.give_way)
        self._diagnostics = self.create_publisher(DiagnosticArray, "diagnostics", TOPIC_QOS)
        self._diagnostics_due = 0.0
        self._beats = create_steady_timer(self, PERIOD, self._beat)
        self.follow_changes(load_service_settings, self._apply_settings)
        self._log_ready()

    def destroy_node(self) -> None:
        """Refuse open questions, end the threads and destroy the node."""
        self.desk.close()
        self._advice.close()
        self.watch.close()
        self._hazards.close()
        self._maps.close()
        self._map_cloud.close()
        self._behind.close()
        super().destroy_node()

    def _create_subscriptions(self) -> None:
        hear, inputs = self.heard.subscribe, self._inputs
        joints = joints_qos(IDLE_PERIOD)
        hear(JointState, "joint_states", lambda one, _: inputs.take_joints(one), joints)
        hear(Odometry, "odometry", self._take_odometry, NEWEST_QOS)
        if self.values.imu_attitude:
            hear(Imu, "imu", lambda one, _: inputs.take_imu(one), NEWEST_QOS)
        reliability = self.values.input_reliability
        subscribe_to_requests(self, Path, "~/path", self._take_path, reliability, raw=True)
        qos = make_qos(10, reliability)
        hear(String, "~/ground_estimate", self._take_ground, qos)
        self.create_subscription(String, "~/mark_place", self._take_mark, qos)
        # Only a transient-local one hears of places that were marked before a restart. It does not
        # warn of publishers that the other one hears.
        quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
        self.create_subscription(
            String, "~/mark_place", self._take_mark, RESULT_QOS, event_callbacks=quiet
        )

    def _log_ready(self) -> None:
        name, known = self.service.settings.rover.name, self.service.known_map
        there = "no map yet"
        if known is not None:
            there = f"map {known.source}: {describe_terrain(known.terrain)}"
        self.get_logger().info(f"ready for rover {name}, {there}")

    def _apply_settings(self, settings: ServiceSettings) -> None:
        before, self.service.settings = self.service.settings, settings
        self._maps.apply(before.parameters)
        self.watch.apply()
        self.frames.apply_timeout(self.values.transform_timeout)
        self._hazards.apply()

    def _beat(self) -> None:
        """Do all that is done again and again; each timer of its own would cost a wake-up."""
        self.heard.poll()
        self.watch.beat()
        self._results.serve_late_comers()
        self._hazards.catch_up()
        now = time.monotonic()
        if now >= self._diagnostics_due:
            # Half a beat early: one that comes a little sooner than due must not be left out.
            self._diagnostics_due = now + DIAGNOSTICS_PERIOD - 0.5 * PERIOD
            self._publish_diagnostics()
        self._set_pace()

    def _set_pace(self) -> None:
        """Beat less often while no path is watched: each wake-up of the executor takes long."""
        period = round(NANOSECONDS * (IDLE_PERIOD if self.watch.is_idle else PERIOD))
        if self._beats.timer_period_ns != period:
            self._beats.timer_period_ns = period
            self._beats.reset()

    def _hear_of_map(self, error: str) -> None:
        """Note why a map was refused, or have the watch look at a new one at once."""
        self.desk.health.take_map(error)
        if not error:
            self.watch.look()

    def _take_odometry(self, odometry: Any, _arrival: float) -> None:
        self._inputs.take_odometry(odometry)
        self._maps.look_under_rover()

    def _take_ground(self, message: String, _arrival: float) -> None:
        """Take what was learned of the ground: JSON as the command learn writes it."""
        now = stamp_text(self.get_clock().now().nanoseconds)
        self.service.take_ground(parse_learned(message.data, "~/ground_estimate", now))

    def _take_mark(self, message: String) -> None:
        """Take a place that is impassable from now on: JSON with x, y, radius, reason, date."""
        try:
            place = parse_place(message.data, "~/mark_place")
        except RoverError as error:
            self.get_logger().warning(f"not used: {error}")
            return
        if self.service.mark(place):
            self.get_logger().warning(place.describe())

    def _clear_marks(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        count = len(self.service.marked.places)
        self.service.marked = NONE_MARKED
        response.success = count > 0
        response.message = f"{count} marked places cleared"
        return response

    def _take_path(self, message: bytes) -> None:
        about = "", ""
        try:
            self._check_length(count_poses(message))
            path = read_message(message, Path)
            about = describe_path(path)
            self.service.given_path = self._inputs.read_path(path)
        except RoverError as error:
            # Later questions must not be about an outdated one.
            refused = f"the last path was refused: {error}"
            self.service.given_path = GivenPath(None, refused, *about)
            self.get_logger().error(f"~/path refused: {error}")

    def _check_length(self, poses: int) -> None:
        """Raise MessageError if a path has too many poses."""
        most = self.values.max_path_poses
        if poses > most:
            raise MessageError(
                f"path has {poses} poses; it may have {most}: leave some out, or set the "
                "parameter max_path_poses"
            )

    def read_path(self, path: Path) -> GivenPath:
        """Return a path of the robot as one of the body in the map frame, or why it is refused."""
        try:
            self._check_length(len(path.poses))
            return self._inputs.read_path(path)
        except RoverError as error:
            return GivenPath(None, str(error), *describe_path(path), code="bad_request")

    def read_question(self, request: GetPlan.Request) -> PathQuestion:
        """Return the question for a path between poses of the robot, by the transforms of now.

        An empty start is where the rover is.
        """
        begin, end, tolerance = request.start, request.goal, request.tolerance
        about, read = plan_request_hash(begin, end, tolerance), self.frames.read_pose
        try:
            start = self._find_here() if is_empty(begin) else read(begin, "start")
            return PathQuestion(start, read(end, "goal"), tolerance, about)
        except RoverError as error:
            return PathQuestion(hash=about, refusal=str(error))

    def _fill_plan(
        self, _request: object, response: GetPlan.Response, answer: Answer[PathJudgement]
    ) -> None:
        response.plan = self.publish(answer.judgement, answer.identity).plan

    def _find_watched(self) -> Pose | None:
        """Return the pose (3,) of the body by /tf, else by odometry of just now."""
        try:
            return self._inputs.find_here(MAX_POSE_AGE)
        except RoverError:  # it is stale
            return None

    def _find_here(self) -> Pose:
        """Return the pose (3,) of the body by /tf, else by odometry."""
        self.heard.poll()
        here = self._inputs.find_here()
        if here is None:
            raise MessageError(
                "start is empty, which means where the rover is, but neither /tf nor odometry of "
                f"the last second says so; give a start in {self.values.map_frame!r}"
            )
        return here

    def _fill_check(
        self, _request: object, response: Trigger.Response, answer: Answer[PathJudgement]
    ) -> None:
        report = self.publish(answer.judgement, answer.identity).report
        response.success = answer.judgement.traversable
        response.message = to_json(to_plain(report))

    def publish(self, judgement: PathJudgement, identity: IdentityReport) -> ResultMessages:
        """Return the results of a judgement, which are published after the answer."""
        results = self._results.take(judgement, identity)
        self._advice.take(judgement)
        if judgement.traversable and judgement.candidate is not None:
            self.watch.accept(judgement.candidate.poses, results.identity.path_hash)
            self._set_pace()
        return results

    def _publish_stop(self, judgement: PathJudgement, watched: str, snapshot: Snapshot) -> None:
        """Publish why the rover is to stop, as the results of a judged path."""
        about = GivenPath(hash=watched)
        self.publish(judgement, self.desk.register.identify("monitor", about, snapshot))

    def _cancel(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        why = CANCELLED, "the question was cancelled by ~/cancel"
        count = self.desk.cancel(*why) + self._advice.cancel(*why)
        response.success = count > 0
        response.message = f"{count} open questions cancelled"
        return response

    def _find_clock_fault(self) -> str:
        """Return that ROS time does not run; empty if it does."""
        clock = self.get_clock()
        is_silent = clock.ros_time_is_active and clock.now().nanoseconds == 0
        return "use_sim_time is true, but nothing was heard on /clock" if is_silent else ""

    def _publish_diagnostics(self) -> None:
        self._map_cloud.update()
        self._maps.retry()
        now = self.get_clock().now()
        snapshot = self.service.snapshot(now.nanoseconds)
        missing, known = snapshot.refuse_map(), snapshot.known_map
        counts = {
            **({"map": "none"} if known is None else known.describe(snapshot.map_age)),
            "open questions": self.desk.open_count,
            "marked places": len(self.service.marked.places),
            "internal errors": self.guard.total,
            **self._hazards.describe(),
            **({"kernels not cached": kernel_cache_note()} if kernel_cache_note() else {}),
        }
        health = self.desk.health.describe(
            time.monotonic(),
            self._find_clock_fault() or ("" if missing is None else missing.reason),
            self.guard.recent(MEMORY),
            counts,
        )
        name = self.service.settings.rover.name
        statuses = [
            make_status(status, one.level, one.message, one.values, name)
            for status, one in ((HEALTH, health), (MONITOR, self.watch.describe()))
        ]
        header = Header(stamp=now.to_msg())
        self._diagnostics.publish(DiagnosticArray(header=header, status=statuses))


main = partial(run_node, NODE_NAME, TraverseServer, SWITCH_INTERVAL)
"""Runs the node until it is stopped; returns 2 for a wrong argument or parameter, else 0."""


if __name__ == "__main__":
    sys.exit(main())
