"""The verdicts of one path under all torque policies, side by side."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from rover_physics.errors import RoverError
from rover_physics.names import EQUAL, OPTIMAL, SERVO, TORQUE_POLICIES
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import Candidate, PathQueryOptions, check_path

POLICY_TITLES = {EQUAL: "equal torques", SERVO: "speed servos", OPTIMAL: "traction control"}
"""What the page calls the policies."""


@dataclass(frozen=True)
class PolicyVerdict:
    """The verdict of a path under one policy."""

    policy: str
    """One of `TORQUE_POLICIES`."""
    traversable: bool | None
    """Whether the rover can drive the path; None if this policy cannot judge it."""
    reason: str
    """Why not; empty if it can."""


def judge_by_policy(
    rover: Rover,
    terrain: Terrain,
    candidate: Candidate,
    options: PathQueryOptions,
    arm_angles: Mapping[str, float],
) -> tuple[PolicyVerdict, ...]:
    """Return the verdicts of a judged path under all policies, up to their first failures.

    Args:
        rover: The rover.
        terrain: The ground.
        candidate: The path; its own verdict counts for its policy.
        options: As for `check_path`; the policy is replaced.
        arm_angles: Angles [rad] of the arm's joints by name.
    """
    found = []
    for policy in TORQUE_POLICIES:
        verdict = candidate.verdict
        if verdict.policy != policy:
            asked = replace(options, policy=policy)
            try:
                judged = check_path(
                    rover, terrain, candidate.poses, asked, arm_angles, stop_at_failure=True
                )
            except RoverError as error:
                found.append(PolicyVerdict(policy, None, str(error)))
                continue
            verdict = judged.verdict
        found.append(PolicyVerdict(policy, verdict.traversable, verdict.reason))
    return tuple(found)
