# SPDX-License-Identifier: Apache-2.0
"""How far a rover extends from its body origin, whatever the angles of its suspension."""

import math
from itertools import pairwise

from rover_physics.rover.model import Rover


def reach_of_links(rover: Rover, wheel: str) -> float:
    """Return how far the centre of a wheel may be from the body's y axis [m].

    It is the sum of its links, each as seen along that axis. `wheel` is one of WHEEL_POSITIONS.
    """
    suspension = rover.suspension
    joints = [(0.0, 0.0, 0.0), suspension.rocker_pivot, suspension.wheels[wheel]]
    if wheel != suspension.rocker_wheel:
        joints.insert(2, suspension.bogie_pivot)
    return sum(math.hypot(b[0] - a[0], b[2] - a[2]) for a, b in pairwise(joints))


def find_reach(rover: Rover) -> float:
    """Return the distance from the body origin that no part of wheels and belly exceeds [m]."""
    wheel, belly = rover.wheel, rover.belly
    centres = (
        math.hypot(place[1], reach_of_links(rover, name))
        for name, place in rover.suspension.wheels.items()
    )
    corner = math.hypot(belly.z, max(map(abs, belly.x)), max(map(abs, belly.y)))
    return max(max(centres) + math.hypot(wheel.radius, 0.5 * wheel.width), corner)
