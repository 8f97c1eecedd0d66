# SPDX-License-Identifier: Apache-2.0
"""Services of a planner for Nav2: the service ~/is_path_valid, the action ~/compute_path_to_pose.

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

from rover_physics.errors import RoverError
from rover_planner.nodes.question_desk import QuestionDesk
from rover_planner.planning.answering.budget import CANCELLED, STOPPING
from rover_planner.planning.answering.judgement import PathJudgement
from rover_planner.planning.answering.questions import (
    Answer,
    Question,
    ask_about_path,
    ask_in_vain,
)
from rover_planner.planning.answering.snapshot import GivenPath
from rover_planner.planning.path_geometry import next_given_poses
from rover_planner.planning.verdict_report import IdentityReport
from rover_planner.ros.deferred_service import Reply, serve_later
from rover_planner.ros.optional_types import find_type
from rover_planner.ros.server_inputs import describe_path

Publish = Callable[[PathJudgement, IdentityReport], Any]
ReadPath = Callable[[Path], GivenPath]
ReadQuestion = Callable[[str, PoseStamped, PoseStamped], Question]


class PathValidity:
    """Answers requests of IsPathValid."""

    def __init__(self, desk: QuestionDesk, read: ReadPath, publish: Publish):
        """Keep what is needed for answers.

        Args:
            desk: Answers the questions.
            read: Returns a path of the robot as one of the body; refuses one that is too long.
            publish: Publishes the results of a judgement.
        """
        self._desk, self._read, self._publish = desk, read, publish

    @staticmethod
    def serve(node: Node, desk: QuestionDesk, read: ReadPath, publish: Publish) -> None:
        """Create the service, where its type is installed."""
        kind = find_type("nav2_msgs.srv:IsPathValid")
        if kind is not None:
            serve_later(node, kind, "~/is_path_valid", PathValidity(desk, read, publish).take)

    def take(self, request: Any, response: Any, reply: Reply) -> None:
        """Take a request; the reply has `is_valid` and `invalid_pose_indices`.

        The indices are those of the given poses at or after waypoints that are not passable. A
        path that is refused before it is judged, such as without a map, has all of them.
        """
        path: Path = request.path
        about, stamp = describe_path(path)
        try:
            given = self._read(path)
            question = ask_about_path("is_path_valid", about, given)
        except RoverError as error:
            question = ask_in_vain("is_path_valid", about, str(error))

        def send(answer: Answer) -> None:
            judged = answer.judgement
            response.is_valid = judged.traversable
            response.invalid_pose_indices = list(range(len(path.poses)))
            if judged.candidate is not None:
                spacing = answer.snapshot.settings.query.waypoint_spacing
                assert given.poses is not None
                response.invalid_pose_indices = find_invalid_poses(
                    judged.candidate.verdict.codes, next_given_poses(given.poses, spacing)
                )
            self._publish(judged, replace(answer.identity, path_hash=about, path_stamp=stamp))
            reply(response)

        self._desk.ask(question, send)


ERRORS = {
    "": "NONE",
    "off_map": "GOAL_OUTSIDE_MAP",
    **dict.fromkeys(("too_long", "out_of_time", "busy"), "TIMEOUT"),
    **dict.fromkeys(("bad_request", "no_map", "stale_map", "internal_error"), "UNKNOWN"),
    **dict.fromkeys((CANCELLED, STOPPING), "UNKNOWN"),
}
"""Names of the errors of ComputePathToPose by the code of a verdict; others are NO_VALID_PATH.
Their numbers differ between releases of Nav2."""


class PathComputation:
    """Answers goals of ComputePathToPose."""

    def __init__(self, desk: QuestionDesk, read: ReadQuestion, publish: Publish, result: type):
        """Keep what is needed for answers.

        Args:
            desk: Answers the questions.
            read: Returns the question of a service, by start and goal of the robot.
            publish: Publishes the results of a judgement and returns the plan first.
            result: Type of the action's result.
        """
        self._desk, self._read, self._publish = desk, read, publish
        self._result = result
        self._answers: dict[int, tuple[bool, Any]] = {}

    @staticmethod
    def serve(node: Node, desk: QuestionDesk, read: ReadQuestion, publish: Publish) -> None:
        """Create the action, where its type is installed."""
        kind: Any = find_type("nav2_msgs.action:ComputePathToPose")
        if kind is None:
            return
        from rclpy.action import ActionServer

        answers = PathComputation(desk, read, publish, kind.Result)
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

        def send(answer: Answer) -> None:
            judged, result = answer.judgement, self._result()
            result.path, _ = self._publish(judged, answer.identity)
            seconds = time.monotonic() - begin
            result.planning_time = Duration(seconds=seconds).to_msg()
            result.error_code = getattr(result, _name_error(judged))
            if hasattr(result, "error_msg"):  # newer than Jazzy's first release
                result.error_msg = "" if judged.traversable else judged.reason
            self._answers[id(handle)] = judged.traversable, result
            handle.execute()

        self._desk.ask(self._read("compute_path_to_pose", start, goal.goal), send)

    def finish(self, handle: Any) -> Any:
        """End a goal whose answer is found; return its result."""
        is_found, result = self._answers.pop(id(handle))
        if is_found:
            handle.succeed()
        else:
            handle.abort()
        return result


def _name_error(judged: PathJudgement) -> str:
    """Return the name of the error of ComputePathToPose for a judgement."""
    if judged.traversable:
        return ERRORS[""]
    name, chosen = ERRORS.get(judged.code, "NO_VALID_PATH"), judged.candidate
    starts_there = chosen is not None and chosen.verdict.first_failure == 0
    return "START_OUTSIDE_MAP" if name == "GOAL_OUTSIDE_MAP" and starts_there else name


def find_invalid_poses(codes: Sequence[str], given: NDArray[np.intp]) -> list[int]:
    """Return the given poses at or after waypoints that are not passable, ascending.

    Args:
        codes: (m,) code of each waypoint, empty if it is passable.
        given: (m,) index of the given pose at or after each waypoint.
    """
    bad = np.array([bool(code) for code in codes], dtype=bool)
    return [int(index) for index in np.unique(given[bad])]
