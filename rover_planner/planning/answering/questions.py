# SPDX-License-Identifier: Apache-2.0
"""The questions of the services as plain values, and what the answer to each is about."""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.traversability.reach import ReachAnswer, judge_reach
from rover_planner.maps.known_map import stamp_text
from rover_planner.parameters.traverse_server import USE
from rover_planner.planning.answering.judgement import refusal
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot
from rover_planner.planning.path_query import Pose
from rover_planner.planning.verdict_report import LEARNED, TOLD, IdentityReport


class ReachRefusal(ReachAnswer):
    """The refusal of a reach query before the model was used."""

    def __init__(self, code: str, reason: str):
        super().__init__(False, False, code, reason)

    def to_dict(self) -> dict[str, Any]:
        """Return the refusal in JSON types."""
        names = ("possible", "reachable", "code", "reason")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, eq=False)
class ReachQuery:
    """The last target and wrench of the tool, or the reasons why they were refused."""

    target: NDArray[np.float64] | None = None
    """Target (3,) of the tip [m], map frame; None if there is none or it was refused."""
    target_refusal: str = "no target was received yet; publish one on ~/tool_target"
    """Reason why there is no target: a later query must not use an outdated one."""
    force: NDArray[np.float64] | None = None
    """Force (3,) [N] on the tip, map frame; None if there is none."""
    moment: NDArray[np.float64] | None = None
    """Moment (3,) [N m] on the tip, map frame; None if there is none."""
    wrench_refusal: str = ""
    """Reason why the last wrench was refused; queries are refused until a valid one arrives."""

    def ask(self, snapshot: Snapshot) -> ReachAnswer:
        """Judge the rover at the last pose of the last path with its tool at the target.

        Args:
            snapshot: What is known of rover, map and path.

        Raises:
            RoverError: The rover has no arm, or the model refuses an option.
        """
        missing = snapshot.refuse_if_missing()
        if missing is not None:
            return ReachRefusal(missing.code, missing.reason)
        if self.target is None:
            return ReachRefusal("no_target", self.target_refusal)
        if self.wrench_refusal:
            return ReachRefusal("no_wrench", self.wrench_refusal)
        settings = snapshot.settings
        joints = settings.manipulator_joints
        unknown = [name for name in joints if name not in snapshot.joints]
        if 0 < len(unknown) < len(joints):
            text = f"joint_states has never had {', '.join(unknown)}, but other joints of the arm"
            return ReachRefusal("missing_joints", f"{text}; it must have all of them, or none")
        assert snapshot.path.poses is not None
        assert snapshot.terrain is not None
        return judge_reach(
            settings.rover,
            snapshot.terrain,
            snapshot.path.poses[-1],
            self.target,
            settings.query.model,
            force=self.force,
            moment=self.moment,
        )


@dataclass(frozen=True, eq=False)
class Question:
    """A question; it is judged in a thread."""

    service: str
    """Name of the service that was asked."""
    hash: str
    """Hash of the request; empty if it has none."""
    judge: Callable[[Any], Any]
    """Returns the judgement by a `Snapshot`, which has a `code`. It may raise a PlanningError or
    RoverError, as the request is refused, or a NewerMapError, to be asked again on the newest
    map."""
    refuse: Callable[[str, str], Any] = refusal
    """Returns a judgement that refuses the question, by code and reason."""


def ask_for_path(
    service: str, about: str, start: Pose, goal: Pose, tolerance: float = 0.0
) -> Question:
    """Return the question whether there is a path; `tolerance` as in `Snapshot.answer` [m]."""
    return Question(service, about, lambda known: known.answer(start, goal, tolerance).complete())


def ask_about_path(service: str, about: str, path: GivenPath) -> Question:
    """Return the question whether the rover can drive a path."""
    return Question(
        service, about, lambda known: replace(known, path=path).check_path().complete()
    )


def ask_in_vain(service: str, about: str, reason: str) -> Question:
    """Return what a request that cannot be read asks; its answer is the reason."""
    return Question(service, about, lambda _known: refusal("bad_request", reason))


@dataclass
class Register:
    """Numbers the answers of a server, and says what each is about."""

    server: str = field(default_factory=lambda: secrets.token_hex(4))
    """Random text of this run of the server."""
    count: int = 0
    """Number of the last answer."""

    def identify(self, service: str, question_hash: str, snapshot: Snapshot) -> IdentityReport:
        """Return what the answer to the next question is about, without its path.

        Args:
            service: Name of the service that was called.
            question_hash: Hash of the request.
            snapshot: What was known when it was asked.
        """
        self.count += 1
        known = snapshot.known_map
        content, stamp = (
            ("", "") if known is None else (known.fingerprint, stamp_text(known.stamp))
        )
        about = self.count, service, self.server, question_hash
        identity = IdentityReport(*about, "", "", content, stamp, snapshot.map_age)
        ground = snapshot.ground
        if ground is None:
            return identity
        return replace(
            identity,
            ground=LEARNED if snapshot.settings.parameters.learn == USE else TOLD,
            ground_friction=ground.mean,
            ground_friction_std=ground.std,
            ground_since=ground.since,
            ground_classes={str(c): mu for c, mu in snapshot.class_friction.items()},
        )
