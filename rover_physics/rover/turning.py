# SPDX-License-Identifier: Apache-2.0
"""How tightly a rover turns: its smallest radius, and whether it turns on the spot."""

import math

import numpy as np

from rover_physics.rover.model import Rover

UPRIGHT = 1e-2
"""Steering limit below a quarter turn [rad] that still counts as one, as 1.57 for pi / 2."""


def tightest_radius(rover: Rover) -> float:
    """Return the smallest radius [m] of a curve of the body origin that the rover drives.

    The inner steered wheels reach their limit there, or stand still. A rover with fixed wheels
    skids in curves; its smallest radius is its wheelbase.
    """
    if rover.steering is None:
        return rover.wheelbase
    limit = rover.steering.limit
    slope = math.inf if limit > 0.5 * math.pi - UPRIGHT else math.tan(limit)
    return max(abs(y) + abs(x) / slope for x, y in _steered_wheels(rover))


def can_turn_on_the_spot(rover: Rover) -> bool:
    """Return whether the steered wheels can point along a turn about the body origin."""
    if rover.steering is None:
        return False
    needed = max(math.atan2(abs(x), abs(y)) for x, y in _steered_wheels(rover))
    return needed <= rover.steering.limit


def swing_radius(rover: Rover) -> float:
    """Return the distance of the outermost wheel from the body origin, seen from above [m]."""
    return max(float(np.hypot(x, y)) for x, y, _ in rover.suspension.wheels.values())


def _steered_wheels(rover: Rover) -> list[tuple[float, float]]:
    assert rover.steering is not None
    wheels = rover.suspension.wheels
    return [(wheels[name][0], wheels[name][1]) for name in rover.steering.wheels]
