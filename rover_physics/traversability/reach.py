# SPDX-License-Identifier: Apache-2.0
"""Reach query: whether the arm of the standing rover can reach a point and push there."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import ModelError, PoseError
from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_physics.numerics.plain_values import to_plain
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.sweep import check_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.manipulator import (
    ROUNDING,
    as_vector,
    distance_to_reach,
    inverse_kinematics,
)
from rover_physics.rover.model import Manipulator, Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_poses
from rover_physics.traversability.verdict import EXTREMES, Verdict

NO_LOAD = (0.0, 0.0, 0.0)
"""Neither force nor moment on the tool."""
OF_THE_VERDICT = ("policy", *(name for name in EXTREMES if name != "max_wheel_drop"))
"""Fields of the verdict that `ReachAnswer.to_dict` includes."""
PER_WHEEL = ("wheel_loads", "tangential", "lateral", "torque", "friction_utilisation")
"""Values of each wheel that it includes, in the order of `names.WHEELS`."""


@dataclass(frozen=True, eq=False)
class ReachAnswer:
    """Answer to a reach query: the arm reaches the point and bears the load, or why not."""

    possible: bool
    """True if the tip reaches the point and the rover holds still within all its limits."""
    reachable: bool
    """True if the arm can bring its tip to the point, even if the rover does not hold still."""
    code: str
    """Empty if possible; "too_far", "too_near" or "joint_limits", else a code of a verdict."""
    reason: str
    """The reason in words, with values; empty if possible."""
    target: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) the point in the body frame [m], NaN where the rover does not settle."""
    out_of_reach: float = np.nan
    """Distance of the point from the arm's reach [m]: above 0 too far, below 0 too near, NaN
    unknown."""
    joint_angles: Mapping[str, float] | None = None
    """Arm angles [rad] by joint name, the safer of the two solutions; None if out of reach."""
    verdict: Verdict | None = None
    """The verdict with the arm at the point, or without it if the rover does not settle; None if
    the point is out of reach."""
    prediction: PathPrediction | None = None
    """Loads, utilisations and margins with the arm at the point, one row; else None."""

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as JSON types; unknown values are None or left out."""
        names = ("possible", "reachable", "code", "reason", "target", "out_of_reach")
        answer = {name: getattr(self, name) for name in (*names, "joint_angles")}
        if self.verdict is not None:
            fields = asdict(self.verdict)
            answer |= {name: fields[name] for name in OF_THE_VERDICT}
        if self.prediction is not None:
            answer |= {name: getattr(self.prediction, name)[0] for name in PER_WHEEL}
        return to_plain(answer)


@quiet
def judge_reach(
    rover: Rover,
    terrain: Terrain,
    pose: ArrayLike,
    target: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    force: ArrayLike | None = None,
    moment: ArrayLike | None = None,
) -> ReachAnswer:
    """Check whether the arm can reach a point, and whether the rover holds a load there.

    The rover stands still; its wheels hold it with the torques of the policy. The strength of the
    arm's joints and collisions of its links are not checked.

    Args:
        rover: The rover; it must have a manipulator.
        terrain: The ground.
        pose: (3,) x, y [m] and yaw [rad] of base_link, map frame.
        target: (3,) point that the tip of the arm has to reach [m], map frame.
        options: As for `judge_path`; its arm angles, tool load and control margin are ignored.
        force: (3,) force of the surroundings on the tip [N], map frame (default: none). A tool
            that presses on the ground is pushed up.
        moment: (3,) moment of the surroundings on the tip [N m], map frame (default: none).

    Returns:
        Whether it can, the code and reason if not, and angles, loads and margins if it reaches.

    Raises:
        PoseError: A pose of wrong shape, or not finite.
        ModelError: A rover without an arm, or an option that this rover cannot have.
        SoilError: A soil that is not a preset.
    """
    arm = rover.manipulator
    if arm is None:
        raise ModelError(f"rover {rover.name!r} has no manipulator to reach with")
    if options.policy == SERVO:
        raise ModelError(
            f"policy {SERVO!r} is for a rover that drives; to stand, use {EQUAL!r} or {OPTIMAL!r}"
        )
    poses = check_poses(np.atleast_2d(pose))
    if len(poses) != 1:
        raise PoseError(f"pose has shape {np.shape(pose)}; it must be one pose (3,): x, y, yaw")
    point = as_vector("target", target)
    load = [
        as_vector(name, NO_LOAD if value is None else value)
        for name, value in (("force", force), ("moment", moment))
    ]
    at_rest = replace(
        options, joint_angles=None, tool_force=None, tool_moment=None, control_margin=0.0
    )
    standing, verdict = judge_poses(rover, terrain, poses, None, at_rest, sigmas=0)
    if not standing.settled[0]:
        return ReachAnswer(False, False, verdict.code, verdict.reason, verdict=verdict)
    to_map = _attitude(standing)
    local = to_map.T @ (point - standing.position[0])
    answers = []
    for angles in inverse_kinematics(arm, local):
        reaching = replace(
            at_rest,
            joint_angles=dict(zip(arm.joints, angles.tolist(), strict=True)),
            tool_force=to_map.T @ load[0],
            tool_moment=to_map.T @ load[1],
        )
        prediction, verdict = judge_poses(rover, terrain, poses, None, reaching, sigmas=0)
        found = verdict.traversable, True, verdict.code, verdict.reason, local, 0.0
        answers.append(ReachAnswer(*found, reaching.arm_angles, verdict, prediction))
    return max(answers, key=_safety) if answers else _refuse_reach(arm, local)


def _safety(answer: ReachAnswer) -> tuple[bool, float]:
    margin = answer.verdict.min_tip_over_ratio if answer.verdict else -np.inf
    return answer.possible, round(margin, 9)


def _refuse_reach(arm: Manipulator, local: np.ndarray) -> ReachAnswer:
    gap = distance_to_reach(arm, local)
    if gap == 0.0:
        code, reason = "joint_limits", _describe_limits(arm, local)
    elif gap > 0.0:
        reach = arm.link_lengths[1] + arm.link_lengths[2]
        code = "too_far"
        reason = f"target is {gap:.3f} m out of reach: {reach + gap:.3f} m from the arm's "
        reason += f"shoulder, which reaches {reach:.3f} m"
    else:
        least = abs(arm.link_lengths[1] - arm.link_lengths[2])
        code = "too_near"
        reason = f"target is {-gap:.3f} m too near: {least + gap:.3f} m from the arm's shoulder, "
        reason += f"which reaches no nearer than {least:.3f} m"
    return ReachAnswer(False, False, code, reason, local, gap)


def _describe_limits(arm: Manipulator, local: np.ndarray) -> str:
    beyond = []
    for angles in inverse_kinematics(replace(arm, joint_limits=None), local):
        for k, (low, high) in enumerate(arm.joint_limits or ()):
            if not low - ROUNDING <= angles[k] <= high + ROUNDING:
                beyond.append(
                    f"{arm.joints[k]} at {angles[k]:.2f} rad, limits {low:.2f} to {high:.2f} rad"
                )
                break
    return f"target is within the arm's length but needs {' or '.join(beyond)}"


def _attitude(standing: PathPrediction) -> np.ndarray:
    angles = [standing.poses[0, 2], standing.pitch[0], standing.roll[0]]
    from scipy.spatial.transform import Rotation  # imported here: it is slow

    return Rotation.from_euler("ZYX", angles).as_matrix()
