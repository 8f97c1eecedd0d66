"""What Nav2 asks a planner: the service ~/is_path_valid, the action ~/compute_path_to_pose.

Both exist where nav2_msgs is installed.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.node import Node

from msg_adapters.identity import path_hash, plan_request_hash
from msg_adapters.paths import path_to_poses
from msg_adapters.stamps import stamp_to_ns
from rover_planner.nodes.question_desk import Inquiry, QuestionDesk
from rover_planner.planning.answering.judgement import Judgement, refusal
from rover_planner.planning.answering.known_map import stamp_text
from rover_planner.planning.answering.situation import GivenPath, Situation
from rover_planner.planning.path_geometry import next_given_poses
from rover_planner.planning.path_planner import Pose
from rover_planner.planning.verdict_report import IdentityReport
from rover_planner.ros.deferred_service import Reply, serve_later
from rover_planner.ros.refusals import attempt

Publish = Callable[[Judgement, IdentityReport], Any]
ReadEnds = Callable[[PoseStamped, PoseStamped], tuple[Pose, Pose]]


def nav2_service() -> type | None:
    """Return nav2_msgs/srv/IsPathValid; None where it is not installed."""
    try:
        from nav2_msgs.srv import IsPathValid
    except ImportError:
        return None
    kind: type = IsPathValid
    return kind


class PathValidity:
    """Answers requests of IsPathValid."""

    def __init__(
        self,
        desk: QuestionDesk,
        map_frame: str,
        publish: Publish,
        localise: Callable[[Path], Path] = lambda path: path,
    ):
        """Keep what is needed for answers.

        Args:
            desk: Answers the questions.
            map_frame: Frame of the map.
            publish: Publishes the results of a judgement.
            localise: Returns a path in the map frame.
        """
        self._desk, self._frame, self._publish = desk, map_frame, publish
        self._localise = localise

    def serve(self, node: Node) -> None:
        """Create the service, where its type is installed."""
        kind = nav2_service()
        if kind is not None:
            serve_later(node, kind, "~/is_path_valid", self.take)

    def take(self, request: Any, response: Any, reply: Reply) -> None:
        """Take a request; the reply has `is_valid` and `invalid_pose_indices`.

        The indices are those of the given poses at or after waypoints that are not passable. A
        path that is refused before it is judged, such as without a map, has all of them.
        """
        path: Path = request.path
        about = path_hash(path), stamp_text(stamp_to_ns(path.header.stamp))
        given: list[NDArray[np.intp]] = []
        located = attempt(lambda: path_to_poses(self._localise(path), self._frame))

        def answer(situation: Situation) -> Judgement:
            poses = located()
            given.append(next_given_poses(poses, situation.settings.query.waypoint_spacing))
            return replace(situation, path=GivenPath(poses, "", *about)).check_path().complete()

        def deliver(judgement: Judgement, identity: IdentityReport) -> None:
            response.is_valid = judgement.traversable
            response.invalid_pose_indices = (
                list(range(len(path.poses)))
                if judgement.candidate is None
                else find_invalid_poses(judgement.candidate.verdict.codes, given[0])
            )
            self._publish(judgement, replace(identity, path_hash=about[0], path_stamp=about[1]))
            reply(response)

        self._desk.ask(Inquiry("is_path_valid", about[0], answer, refusal, deliver))


def nav2_action() -> type | None:
    """Return nav2_msgs/action/ComputePathToPose; None where it is not installed."""
    try:
        from nav2_msgs.action import ComputePathToPose
    except ImportError:
        return None
    kind: type = ComputePathToPose
    return kind


ERROR_CODES = {
    "": 0,
    "bad_request": 201,
    "no_map": 201,
    "stale_map": 201,
    "off_map": 204,
    "too_long": 208,
    "out_of_time": 208,
    "busy": 208,
}
"""Error codes of ComputePathToPose by the code of a verdict; others are NO_VALID_PATH."""
NO_VALID_PATH = 209


class PathComputation:
    """Answers goals of ComputePathToPose."""

    def __init__(self, desk: QuestionDesk, read_ends: ReadEnds, publish: Publish, result: type):
        """Keep what is needed for answers.

        Args:
            desk: Answers the questions.
            read_ends: Returns start and goal (3,) of the body; an empty start is where it is.
            publish: Publishes the results of a judgement and returns the plan first.
            result: Type of the action's result.
        """
        self._desk, self._read_ends, self._publish = desk, read_ends, publish
        self._result = result
        self._answers: dict[int, tuple[bool, Any]] = {}

    @staticmethod
    def serve(node: Node, desk: QuestionDesk, read_ends: ReadEnds, publish: Publish) -> None:
        """Create the action, where its type is installed."""
        kind: Any = nav2_action()
        if kind is None:
            return
        from rclpy.action import ActionServer

        answers = PathComputation(desk, read_ends, publish, kind.Result)
        ActionServer(
            node,
            kind,
            "~/compute_path_to_pose",
            answers.finish,
            handle_accepted_callback=answers.take,
        )

    def take(self, handle: Any) -> None:
        """Take an accepted goal; it is executed, which ends it, once its answer is found."""
        goal, begin = handle.request, time.monotonic()
        start = goal.start if goal.use_start else PoseStamped()
        ends = attempt(lambda: self._read_ends(start, goal.goal))
        about = plan_request_hash(start, goal.goal, 0.0)

        def answer(situation: Situation) -> Judgement:
            return situation.answer(*ends()).complete()

        def deliver(judgement: Judgement, identity: IdentityReport) -> None:
            result = self._result()
            result.path, _ = self._publish(judgement, identity)
            seconds = time.monotonic() - begin
            result.planning_time = Duration(seconds=seconds).to_msg()
            code = "" if judgement.traversable else judgement.code
            result.error_code = ERROR_CODES.get(code, NO_VALID_PATH)
            if hasattr(result, "error_msg"):  # newer than Jazzy's first release
                result.error_msg = "" if judgement.traversable else judgement.reason
            self._answers[id(handle)] = judgement.traversable, result
            handle.execute()

        self._desk.ask(Inquiry("compute_path_to_pose", about, answer, refusal, deliver))

    def finish(self, handle: Any) -> Any:
        """End a goal whose answer is found; return its result."""
        is_found, result = self._answers.pop(id(handle))
        if is_found:
            handle.succeed()
        else:
            handle.abort()
        return result


def find_invalid_poses(codes: Sequence[str], given: NDArray[np.intp]) -> list[int]:
    """Return the given poses at or after waypoints that are not passable, ascending.

    Args:
        codes: (m,) code of each waypoint, empty if it is passable.
        given: (m,) index of the given pose at or after each waypoint.
    """
    bad = np.array([bool(code) for code in codes], dtype=bool)
    return [int(index) for index in np.unique(given[bad])]
