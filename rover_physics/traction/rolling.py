# SPDX-License-Identifier: Apache-2.0
"""The motion in which the wheels of a rover roll with their measured steering angles.

`shares` has the planar motion of the body in which the wheels roll. Here it is scaled so that the
mean speed of the wheels along their headings is 1. It goes forward, or to the left if it is mostly
a turn. Wheels straight ahead have the motion (1, 0, 0).
"""

import numpy as np

from rover_physics.forces.shares import has_turned_wheels, write_shares
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type

ROLLING = record_type(
    ("motion", float, (3,)),  # speed ahead, to the left, yaw rate per mean wheel speed [1, 1, 1/m]
    ("directions", float, (WHEEL_COUNT,)),  # 1 where a wheel rolls forward, -1 where backward
    ("speeds", float, (WHEEL_COUNT,)),  # along the headings on level ground, over the mean speed
    ("thrust", float, (3,)),  # force at the centre of mass and moment of a unit push [1, 1, m]
    ("inertia", float),  # push over acceleration of the mean wheel speed, over the rover's mass
    ("arms", float, (WHEEL_COUNT,)),  # moment about body z per traction [m], positive to the left
)
"""The motion in which the wheels roll with their steering angles."""


class Rolling:
    """A copy of ROLLING, whose fields are attributes."""

    def __init__(self, packed: np.ndarray):
        """Give the fields of `packed`, an array (1,) of ROLLING, their names."""
        self.motion, self.directions = packed["motion"][0], packed["directions"][0]
        self.speeds, self.arms = packed["speeds"][0], packed["arms"][0]
        self.inertia = float(packed["inertia"][0])


@kernel
def write_rolling(linkage, placement, com, shares, rolling):
    """Write how placed wheels roll.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT.
        com: (3,) centre of mass of the rover [m], body frame, where a push acts.
        shares: SHARES, written.
        rolling: ROLLING, written.
    """
    write_shares(linkage, placement, shares)
    motion, speeds, length = rolling.motion, rolling.speeds, linkage.length
    turned = has_turned_wheels(placement)
    motion[0], motion[1], motion[2] = 1.0, 0.0, 0.0
    if turned:
        motion[0], motion[1] = shares.rolling[0], shares.rolling[1]
        motion[2] = shares.rolling[2] / length
    mean = 0.0
    for wheel in range(WHEEL_COUNT):
        x, y = _place_of(placement, wheel)
        ahead, left = 1.0, 0.0
        if turned:
            # The heading is a quarter turn to the right of the axle.
            ahead, left = shares.axles[wheel, 1], -shares.axles[wheel, 0]
        rolling.arms[wheel] = x * left - y * ahead
        rolling.directions[wheel] = shares.common[wheel, 2]
        speeds[wheel] = ahead * (motion[0] - motion[2] * y) + left * (motion[1] + motion[2] * x)
        mean += rolling.directions[wheel] * speeds[wheel] / WHEEL_COUNT
    if turned:
        for k in range(3):
            motion[k] /= mean
        for wheel in range(WHEEL_COUNT):
            speeds[wheel] /= mean
    # Yaw inertia of a mass at the distance of the middle wheels.
    squared_radius = linkage.wheels[1, 1] * linkage.wheels[1, 1]
    ahead, left = motion[0] - motion[2] * com[1], motion[1] + motion[2] * com[0]
    inertia = ahead * ahead + left * left + squared_radius * motion[2] * motion[2]
    rolling.inertia = inertia
    rolling.thrust[0], rolling.thrust[1] = ahead / inertia, left / inertia
    rolling.thrust[2] = squared_radius * motion[2] / inertia


@kernel
def _place_of(placement, wheel):
    """Return the position of a wheel along body x and y [m]."""
    R, origin, centres = placement.R, placement.origin, placement.centres
    x = y = 0.0
    for i in range(3):
        x += R[i, 0] * (centres[wheel, i] - origin[i])
        y += R[i, 1] * (centres[wheel, i] - origin[i])
    return x, y
