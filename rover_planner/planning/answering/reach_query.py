# SPDX-License-Identifier: Apache-2.0
"""Queries whether the arm can reach a target and hold a load there, without ROS."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.traversability.reach import ReachAnswer, judge_reach
from rover_planner.planning.answering.snapshot import Snapshot


@dataclass(frozen=True, eq=False)
class ArmJudgement:
    """The answer of the model, or a refusal before the model was used."""

    possible: bool
    """True if the tip reaches the target and the rover holds still within all its limits."""
    code: str
    """Code of the reason why not, as in a `ReachAnswer` or a refusal; empty if possible."""
    reason: str
    """Reason why not, in words; empty if possible."""
    answer: ReachAnswer | None = None
    """The answer of the model; None after a refusal."""

    def to_dict(self) -> dict[str, Any]:
        """Return the answer in JSON types; unknown values are None or left out."""
        if self.answer is not None:
            return self.answer.to_dict()
        said = {"code": self.code, "reason": self.reason}
        return {"possible": self.possible, "reachable": False, **said}


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

    def ask(self, snapshot: Snapshot) -> ArmJudgement:
        """Judge the rover at the last pose of the last path with its tool at the target.

        Args:
            snapshot: What is known of rover, map and path.

        Raises:
            RoverError: The rover has no arm, or the model refuses an option.
        """
        missing = snapshot.refuse_if_missing()
        if missing is not None:
            return refuse_reach(missing.code, missing.reason)
        if self.target is None:
            return refuse_reach("no_target", self.target_refusal)
        if self.wrench_refusal:
            return refuse_reach("no_wrench", self.wrench_refusal)
        settings = snapshot.settings
        arm = settings.rover.manipulator
        if arm is None:
            raise ModelError(f"rover {settings.rover.name!r} has no manipulator to reach with")
        unknown = [name for name in arm.joints if name not in snapshot.joints]
        if 0 < len(unknown) < len(arm.joints):
            text = f"joint_states has never had {', '.join(unknown)}, but other joints of the arm"
            return refuse_reach("missing_joints", f"{text}; it must have all of them, or none")
        assert snapshot.path.poses is not None
        assert snapshot.terrain is not None
        answer = judge_reach(
            settings.rover,
            snapshot.terrain,
            snapshot.path.poses[-1],
            self.target,
            settings.query.model,
            force=self.force,
            moment=self.moment,
        )
        return ArmJudgement(answer.possible, answer.code, answer.reason, answer)


def refuse_reach(code: str, reason: str) -> ArmJudgement:
    """Return the refusal of a query without using the model."""
    return ArmJudgement(False, code, reason)
