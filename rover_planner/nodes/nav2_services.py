# SPDX-License-Identifier: Apache-2.0
"""Services of a planner for Nav2: the service ~/is_path_valid, the action ~/compute_path_to_pose.

Both exist where nav2_msgs is installed.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.node import Node

from rover_planner.nodes.question_desk import Answer, QuestionDesk
from rover_planner.nodes.result_topics import ResultMessages
from rover_planner.planning.answering.budget import CANCELLED, STOPPING
from rover_planner.planning.answering.judgement import IdentityReport, PathJudgement
from rover_planner.planning.answering.questions import Question
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.planning.path_geometry import densify
from rover_planner.shell.extras import find_type

NO_PATH = "NO_VALID_PATH"
ERRORS = {
    "": "NONE",
    "off_map": "GOAL_OUTSIDE_MAP",
    **dict.fromkeys(("too_long", "out_of_time", "busy"), "TIMEOUT"),
    **dict.fromkeys(("bad_request", "no_map", "stale_map", "internal_error"), "UNKNOWN"),
    **dict.fromkeys((CANCELLED, STOPPING), "UNKNOWN"),
}
"""Names of the errors of ComputePathToPose by the code of a verdict; others are NO_PATH.
Their numbers differ between releases of Nav2."""


class Nav2Services:
    """Answers requests of IsPathValid and goals of ComputePathToPose."""

    def __init__(
        self,
        node: Node,
        desk: QuestionDesk,
        read_path: Callable[[Path], GivenPath],
        read_question: Callable[[GetPlan.Request], Question],
        publish: Callable[[PathJudgement, IdentityReport], ResultMessages],
    ):
        """Create service and action, where their types are installed.

        Args:
            node: The node.
            desk: Answers the questions.
            read_path: Returns a path of the robot as one of the body, or why it is refused.
            read_question: Returns the question for a path of the robot.
            publish: Publishes the results of a judgement and returns them.
        """
        self._desk, self._read_question, self._publish = desk, read_question, publish
        self._answers: dict[int, Answer[PathJudgement]] = {}
        is_valid = find_type("nav2_msgs.srv:IsPathValid")
        if is_valid is not None:
            desk.serve(is_valid, "is_path_valid", lambda asked: read_path(asked.path), self.fill)
        action: Any = find_type("nav2_msgs.action:ComputePathToPose")
        self.make_result: Callable[[], Any] | None = None
        """Makes an empty result of the action."""
        if action is not None:
            from rclpy.action import ActionServer

            self.make_result = action.Result
            ActionServer(
                node,
                action,
                # ROS 2 Jazzy remaps services and topics, but not actions.
                node.resolve_service_name("~/compute_path_to_pose"),
                self.finish,
                handle_accepted_callback=self.compute,
            )

    def fill(self, request: Any, response: Any, answer: Answer[PathJudgement]) -> None:
        """Fill a response of IsPathValid: `is_valid` and `invalid_pose_indices`.

        The indices are those of the given poses at or after waypoints that are not passable. A
        path that is refused before it is judged, such as without a map, has all of them.
        """
        judged, given = answer.judgement, answer.question
        response.is_valid = judged.traversable
        response.invalid_pose_indices = list(range(len(request.path.poses)))
        if judged.candidate is not None:
            assert judged.site is not None
            assert isinstance(given, GivenPath) and given.poses is not None
            _, next_given = densify(given.poses, judged.site.options.waypoint_spacing)
            codes = judged.candidate.verdict.codes
            response.invalid_pose_indices = find_invalid_poses(codes, next_given)
        self._publish(judged, answer.identity)

    def compute(self, handle: Any) -> None:
        """Take an accepted goal; it is executed, which ends it, once its answer is found."""
        goal = handle.request
        request = GetPlan.Request(goal=goal.goal)
        if goal.use_start:
            request.start = goal.start

        def execute(answer: Answer[PathJudgement]) -> None:
            self._answers[id(handle)] = answer
            handle.execute()

        self._desk.ask("compute_path_to_pose", self._read_question(request), execute)

    def finish(self, handle: Any) -> Any:
        """End a goal whose answer is found; return its result."""
        answer = self._answers.pop(id(handle))
        judged = answer.judgement
        assert self.make_result is not None
        result = self.make_result()
        result.path = self._publish(judged, answer.identity).plan
        result.planning_time = Duration(seconds=answer.latency).to_msg()
        result.error_code = getattr(result, _name_error(judged))
        if hasattr(result, "error_msg"):  # newer than Jazzy's first release
            result.error_msg = "" if judged.traversable else judged.reason
        if judged.traversable:
            handle.succeed()
        else:
            handle.abort()
        return result


def _name_error(judged: PathJudgement) -> str:
    """Return the name of the error of ComputePathToPose for a judgement."""
    if judged.traversable:
        return ERRORS[""]
    name, chosen = ERRORS.get(judged.code, NO_PATH), judged.candidate
    if name != "GOAL_OUTSIDE_MAP" or chosen is None or judged.site is None:
        return name
    if chosen.verdict.first_failure == 0:
        return "START_OUTSIDE_MAP"
    return NO_PATH if judged.site.terrain.contains(*chosen.poses[-1, :2]) else name


def find_invalid_poses(codes: Sequence[str], given: NDArray[np.intp]) -> list[int]:
    """Return the given poses at or after waypoints that are not passable, ascending.

    Args:
        codes: (m,) code of each waypoint, empty if it is passable.
        given: (m,) index of the given pose at or after each waypoint.
    """
    bad = np.array([bool(code) for code in codes], dtype=bool)
    return [int(index) for index in np.unique(given[bad])]
