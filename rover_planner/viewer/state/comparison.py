# SPDX-License-Identifier: Apache-2.0
"""The verdict of one path under one torque policy, of several shown side by side."""

from dataclasses import dataclass

from rover_physics.names import EQUAL, OPTIMAL, SERVO

POLICY_TITLES = {EQUAL: "equal torques", SERVO: "speed servos", OPTIMAL: "traction control"}
"""What the page calls the policies."""


@dataclass(frozen=True)
class PolicyVerdict:
    """The verdict of a path under one policy."""

    policy: str
    """One of `TORQUE_POLICIES`."""
    traversable: bool | None
    """Whether the rover can drive the path; None if this policy cannot judge it or did not yet."""
    reason: str
    """Why not; empty if it can."""
    is_old: bool = False
    """Whether it is of other values than the verdict beside it, or not known yet."""
