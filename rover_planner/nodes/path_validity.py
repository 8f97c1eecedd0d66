"""The service ~/is_path_valid of Nav2: the path is in the request, bad poses in the answer.

It exists where nav2_msgs is installed.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.node import Node

from msg_adapters.identity import path_hash
from msg_adapters.paths import path_to_poses
from msg_adapters.stamps import stamp_to_ns
from rover_planner.nodes.question_desk import Inquiry, QuestionDesk
from rover_planner.planning.answering.judgement import Judgement, refusal
from rover_planner.planning.answering.known_map import stamp_text
from rover_planner.planning.answering.situation import GivenPath, Situation
from rover_planner.planning.path_geometry import next_given_poses
from rover_planner.planning.verdict_report import IdentityReport
from rover_planner.ros.deferred_service import Reply, serve_later

Publish = Callable[[Judgement, IdentityReport], Any]


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

    def __init__(self, desk: QuestionDesk, map_frame: str, publish: Publish):
        """Keep what is needed for answers.

        Args:
            desk: Answers the questions.
            map_frame: Frame of the map.
            publish: Publishes the results of a judgement.
        """
        self._desk, self._frame, self._publish = desk, map_frame, publish

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

        def answer(situation: Situation) -> Judgement:
            poses = path_to_poses(path, self._frame)
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


def find_invalid_poses(codes: Sequence[str], given: NDArray[np.intp]) -> list[int]:
    """Return the given poses at or after waypoints that are not passable, ascending.

    Args:
        codes: (m,) code of each waypoint, empty if it is passable.
        given: (m,) index of the given pose at or after each waypoint.
    """
    bad = np.array([bool(code) for code in codes], dtype=bool)
    return [int(index) for index in np.unique(given[bad])]
