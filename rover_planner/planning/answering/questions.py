# SPDX-License-Identifier: Apache-2.0
"""The questions of the services as plain values, their answers, and what each is about."""

import secrets
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any

from rover_planner.maps.known_map import stamp_text
from rover_planner.parameters.traverse_server import USE
from rover_planner.planning.answering.judgement import refusal
from rover_planner.planning.answering.reach_query import ReachQuery, refuse_reach
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot
from rover_planner.planning.path_query import Pose
from rover_planner.planning.verdict_report import LEARNED, TOLD, IdentityReport


@dataclass(frozen=True, eq=False)
class Question(ABC):
    """A question; it is judged in a thread."""

    service: str
    """Name of the service that was asked."""
    hash: str
    """Hash of the request; empty if it has none."""

    @abstractmethod
    def judge(self, snapshot: Snapshot) -> Any:
        """Return the judgement, which has a `code`.

        Raises:
            PlanningError: The request is invalid.
            RoverError: The model refuses the request.
            NewerMapError: It is to be judged again on the newest map.
        """

    def refuse(self, code: str, reason: str) -> Any:
        """Return a judgement that refuses the question."""
        return refusal(code, reason)


@dataclass(frozen=True, eq=False)
class PathQuestion(Question):
    """Is there a path from start to goal?"""

    start: Pose
    """(3,) x, y [m], yaw [rad] of the body, map frame."""
    goal: Pose
    """The same."""
    tolerance: float = 0.0
    """As in `Snapshot.answer` [m]."""

    def judge(self, snapshot: Snapshot) -> Any:
        """Return the judgement of the best path."""
        return snapshot.answer(self.start, self.goal, self.tolerance).complete()


@dataclass(frozen=True, eq=False)
class PathCheck(Question):
    """Can the rover drive a path?"""

    path: GivenPath
    """The path."""

    def judge(self, snapshot: Snapshot) -> Any:
        """Return the judgement of the path."""
        return replace(snapshot, path=self.path).check_path().complete()


@dataclass(frozen=True, eq=False)
class ReachCheck(Question):
    """Can the arm reach its target at the end of the last path?"""

    query: ReachQuery
    """Target and wrench, which do not change."""

    def judge(self, snapshot: Snapshot) -> Any:
        """Return the judgement of the arm."""
        return self.query.ask(snapshot)

    def refuse(self, code: str, reason: str) -> Any:
        """Return a judgement that refuses the question."""
        return refuse_reach(code, reason)


@dataclass(frozen=True, eq=False)
class BadQuestion(Question):
    """A request that cannot be read."""

    reason: str
    """Reason why not."""

    def judge(self, _snapshot: Snapshot) -> Any:
        """Return the refusal."""
        return self.refuse("bad_request", self.reason)


@dataclass(frozen=True, eq=False)
class Answer:
    """The answer to a question."""

    judgement: Any
    """A `PathJudgement` or `ArmJudgement`."""
    snapshot: Snapshot
    """Map, settings, path and measurements that it was judged by."""
    identity: IdentityReport
    """Its question, path and map."""


@dataclass
class Register:
    """Numbers the questions of a server, and says what each answer is about."""

    server: str = field(default_factory=lambda: secrets.token_hex(4))
    """Random text of this run of the server."""
    count: int = 0
    """Number of the last question."""

    def next_number(self) -> int:
        """Return the number of a new question, one above the last."""
        self.count += 1
        return self.count

    def identify(
        self, number: int, service: str, question_hash: str, snapshot: Snapshot
    ) -> IdentityReport:
        """Return what the answer to a question is about, without its path.

        Args:
            number: Number of the question.
            service: Name of the service that was called.
            question_hash: Hash of the request.
            snapshot: What was known when it was asked.
        """
        known = snapshot.known_map
        content, stamp = (
            ("", "") if known is None else (known.fingerprint, stamp_text(known.stamp))
        )
        about = number, service, self.server, question_hash
        identity = IdentityReport(*about, "", "", content, stamp, snapshot.map_age)
        ground = snapshot.ground
        if ground is None:
            return identity
        return replace(
            identity,
            ground=LEARNED if snapshot.settings.learn == USE else TOLD,
            ground_friction=ground.mean,
            ground_friction_std=ground.std,
            ground_since=ground.since,
        )
