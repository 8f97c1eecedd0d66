# SPDX-License-Identifier: Apache-2.0
"""The questions of the services as plain values, and what the answer to each is about."""

import secrets
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.traversability.reach import ReachAnswer, judge_reach
from rover_planner.maps.known_map import stamp_text
from rover_planner.parameters.traverse_server import USE
from rover_planner.planning.answering.judgement import (
    LEARNED,
    TOLD,
    IdentityReport,
    PathJudgement,
    refusal,
)
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot


@dataclass(frozen=True, eq=False)
class PathQuestion:
    """Whether there is a path from start to goal."""

    start: ArrayLike = ()
    """(3,) x, y [m], yaw [rad] of the body, map frame."""
    goal: ArrayLike = ()
    """(3,) x, y [m], yaw [rad] of the body, map frame."""
    tolerance: float = 0.0
    """As in `Snapshot.answer` [m]."""
    hash: str = ""
    """Hash of the request; empty if it has none."""
    refusal: str = ""
    """Why the request cannot be read, which is the answer then; empty if it can."""

    def judge(self, snapshot: Snapshot) -> PathJudgement:
        """Find a path; errors are those of `Snapshot.answer`."""
        if self.refusal:
            return refusal("bad_request", self.refusal)
        return snapshot.answer(self.start, self.goal, self.tolerance).complete()


@dataclass(frozen=True, eq=False)
class ReachQuery:
    """Whether the tool reaches the last target with the last wrench, or why they were refused."""

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
    hash: str = ""
    """Hash of the request, which has none."""

    def judge(self, snapshot: Snapshot) -> ReachAnswer | PathJudgement:
        """Judge the rover at the last pose of the last path with its tool at the target.

        Raises:
            RoverError: The rover has no arm, or the model refuses an option.
        """
        missing = snapshot.refuse_if_missing()
        if missing is not None:
            return missing
        if self.target is None:
            return refusal("no_target", self.target_refusal)
        if self.wrench_refusal:
            return refusal("no_wrench", self.wrench_refusal)
        settings = snapshot.settings
        joints = settings.manipulator_joints
        unknown = [name for name in joints if name not in snapshot.joints]
        if 0 < len(unknown) < len(joints):
            text = f"joint_states has never had {', '.join(unknown)}, but other joints of the arm"
            return refusal("missing_joints", f"{text}; it must have all of them, or none")
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


Question = PathQuestion | GivenPath | ReachQuery
"""What a service asks. It judges itself by a snapshot; a RoverError refuses it."""


@dataclass
class Register:
    """Numbers the answers of a server, and says what each is about."""

    server: str = field(default_factory=lambda: secrets.token_hex(4))
    """Random text of this run of the server."""
    count: int = 0
    """Number of the last answer."""

    def identify(self, service: str, question: Question, snapshot: Snapshot) -> IdentityReport:
        """Return what the answer to the next question is about.

        Args:
            service: Name of the service that was called.
            question: The question.
            snapshot: What was known when it was asked.
        """
        self.count += 1
        path = question if isinstance(question, GivenPath) else GivenPath()
        known = snapshot.known_map
        content, stamp = (
            ("", "") if known is None else (known.fingerprint, stamp_text(known.stamp))
        )
        about = self.count, service, self.server, question.hash, path.hash, path.stamp
        identity = IdentityReport(*about, content, stamp, snapshot.map_age)
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
