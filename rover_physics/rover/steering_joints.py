# SPDX-License-Identifier: Apache-2.0
"""The steered wheels of a rover: their joints, sign and limit, and how tightly it turns."""

import math

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.names import STEERING_JOINTS, WHEEL_POSITIONS
from rover_physics.rover.model import Rover

LEFT, RIGHT = "left", "right"
"""Sides to which positive steering angles of messages may turn: to the left in REP-103, and here;
some rovers have it the other way round."""
MARGIN = 1e-3
"""Angle by which a limit may be rounded [rad]."""


UPRIGHT = 1e-2
"""Steering limit below a quarter turn [rad] that still counts as one, as 1.57 for pi / 2."""


def steered_wheels(rover: Rover) -> NDArray[np.intp]:
    """Return the indices of the wheels that steer, in wheel order; empty if all are fixed."""
    axles = () if rover.steering is None else rover.steering.wheels
    return np.flatnonzero([position in axles for position in WHEEL_POSITIONS * 2])


def steering_joints(rover: Rover) -> tuple[str, ...]:
    """Return the names of the joints of these wheels, in the same order."""
    return tuple(STEERING_JOINTS[wheel] for wheel in steered_wheels(rover).tolist())


def check_joint_limit(rover: Rover, joint_limit: float) -> None:
    """Check that the joints reach the angles for which curves and turns are planned.

    Args:
        rover: The rover; curves are planned up to its steering limit, but no wheel needs more than
            a quarter turn, as it rolls backwards as well.
        joint_limit: Largest angle of the joints [rad].

    Raises:
        ModelError: The joints do not reach the limit of the rover file.
    """
    if rover.steering is None:
        return
    asked = min(rover.steering.limit, 0.5 * math.pi)
    if joint_limit < asked - MARGIN:
        raise ModelError(
            f"steering joints of {rover.name} reach {joint_limit:g} rad, but curves and turns on "
            f"the spot are planned with up to {asked:.4g} rad; steering.limit of the rover file "
            f"must be at most {joint_limit:g}"
        )


def tightest_radius(rover: Rover) -> float:
    """Return the smallest radius [m] of a curve of the body origin that the rover drives.

    The inner steered wheels reach their limit there, or stand still. A rover with fixed wheels
    skids in curves; its smallest radius is its wheelbase.
    """
    if rover.steering is None:
        return rover.wheelbase
    limit = rover.steering.limit
    slope = math.inf if limit > 0.5 * math.pi - UPRIGHT else math.tan(limit)
    return max(abs(y) + abs(x) / slope for x, y in _steered_places(rover))


def can_turn_on_the_spot(rover: Rover) -> bool:
    """Return whether the steered wheels can point along a turn about the body origin."""
    if rover.steering is None:
        return False
    needed = max(math.atan2(abs(x), abs(y)) for x, y in _steered_places(rover))
    return needed <= rover.steering.limit


def swing_radius(rover: Rover) -> float:
    """Return the distance of the outermost wheel from the body origin, seen from above [m]."""
    return max(float(np.hypot(x, y)) for x, y, _ in rover.suspension.wheels.values())


def _steered_places(rover: Rover) -> list[tuple[float, float]]:
    """Return x, y [m] of the steered wheels of the left side."""
    assert rover.steering is not None
    wheels = rover.suspension.wheels
    return [(wheels[name][0], wheels[name][1]) for name in rover.steering.wheels]
