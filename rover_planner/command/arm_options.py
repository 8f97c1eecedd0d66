"""The options of the command line that are about the manipulator, from text to checked values."""

import math
from collections.abc import Sequence

from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError


def read_arm_angles(rover: Rover, words: Sequence[str]) -> dict[str, float] | None:
    """Return the angles [rad] of all joints of the arm by name, None (stowed) without words.

    Args:
        rover: The rover.
        words: Each as NAME=RAD; all joints of the arm, once, in any order.

    Raises:
        PlanningError: A rover without an arm, words of another form, an angle that is not
            finite, or joints unknown, named twice or missing.
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
