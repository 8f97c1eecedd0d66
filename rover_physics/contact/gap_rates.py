# SPDX-License-Identifier: Apache-2.0
"""Derivatives of the gaps between wheels and ground by the rover's configuration."""

from enum import IntEnum

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.rover.linkage import rocker_sign


class GroundSlope(IntEnum):
    """Slope of the ground that the derivatives of the gaps assume."""

    LEVEL = 0
    """Level ground under each wheel."""
    SLOPED = 1
    """The slope at the contact."""


@kernel
def write_gap_rates(linkage, placement, contacts, ground_is, J):
    """Write the derivatives of the gaps by q into J (6, 6) [m/m or m/rad].

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT at q.
        contacts: CONTACTS with points and normals.
        ground_is: A GroundSlope.
        J: (6, 6), row per wheel, column per element of q; written.
    """
    J[:, :] = 0.0
    R, origin = placement.R, placement.origin
    point, normal = contacts.point, contacts.normal
    length = np.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    body_x = R[0, 0], R[1, 0], R[2, 0]
    body_y = R[0, 1], R[1, 1], R[2, 1]
    level_y = -(R[1, 0] / length), R[0, 0] / length, 0.0
    slope = 0.0, 0.0
    for i in range(6):
        side = i // 3
        if ground_is == GroundSlope.SLOPED:
            slope = normal[i, 0], normal[i, 1]
        arm = _arm_from(origin, point[i])
        J[i, 0] = 1.0
        J[i, 1] = _gap_rate(body_x, arm, slope)
        J[i, 2] = _gap_rate(level_y, arm, slope)
        arm = _arm_from(placement.rocker_pivots[side], point[i])
        J[i, 3] = rocker_sign(side) * _gap_rate(body_y, arm, slope)
        if linkage.on_bogie[i]:
            arm = _arm_from(placement.bogie_pivots[side], point[i])
            J[i, 4 + side] = _gap_rate(body_y, arm, slope)


@kernel
def _arm_from(pivot, point):
    """Return the vector (x, y, z) [m] from a pivot (3,) to a point (3,)."""
    return point[0] - pivot[0], point[1] - pivot[1], point[2] - pivot[2]


@kernel
def _gap_rate(axis, arm, slope):
    """Return the change of the gap at the end of `arm` per rotation about an axis [m/rad].

    `axis` and `arm` are (x, y, z), `slope` the (x, y) of the contact normal.
    """
    ax, ay, az = axis
    dx, dy, dz = arm
    nx, ny = slope
    return nx * (ay * dz - az * dy) + ny * (az * dx - ax * dz) + (ax * dy - ay * dx)
