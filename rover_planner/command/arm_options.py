# SPDX-License-Identifier: Apache-2.0
"""Reads the command-line options of the manipulator and checks their values."""

import math
from collections.abc import Sequence

from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError


def read_arm_angles(rover: Rover, words: Sequence[str]) -> dict[str, float] | None:
    """Return the angles [rad] of all arm joints by name; None (stowed) if `words` is empty.

    Args:
        rover: The rover.
        words: NAME=RAD for each joint of the arm, each joint once, in any order.

    Raises:
        PlanningError: The rover has no arm, a word has another form, an angle is not finite, or
            a joint is unknown, named twice or missing.
    """
    if not words:
        return None
    arm = rover.manipulator
    if arm is None:
        raise PlanningError(f"--arm {words[0]}: rover {rover.name!r} has no manipulator")
    known = ", ".join(arm.joints)
    angles: dict[str, float] = {}
    for word in words:
        name, _, text = word.partition("=")
        try:
            angle = float(text)
        except ValueError:
            angle = math.nan
        if not math.isfinite(angle):
            raise PlanningError(
                f"--arm is {word!r}; it must be NAME=RAD, such as {arm.joints[0]}=0.5"
            )
        if name not in arm.joints:
            raise PlanningError(f"--arm {word}: no joint {name!r}; joints are {known}")
        if name in angles:
            raise PlanningError(f"--arm names {name} twice")
        angles[name] = angle
    missing = [name for name in arm.joints if name not in angles]
    if missing:
        raise PlanningError(f"--arm lacks {', '.join(missing)}; give all joints: {known}")
    return angles
