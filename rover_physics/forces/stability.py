# SPDX-License-Identifier: Apache-2.0
"""Tip-over measures: the paper's ratio of angles, and the force-angle measure.

The support polygon of a rocker-bogie rover has four corners. A bogie turns freely, so the net
force of the ground on it passes through its pivot: the corner is where the line through the pivot
meets the line between the bogie's two contacts. The other two corners are the contacts of the
wheels on the rockers. A rover tips over an edge of this polygon when the wheel loads beyond the
edge become zero. This is exact sideways; up and down a slope the tractions shift the angle by a
few degrees.

Source: Papadopoulos and Rey, "A New Measure of Tipover Stability Margin for Mobile Manipulators",
IEEE ICRA 1996: eqs for a_i, l_i, f_i*, theta_i, d_i and alpha = min theta_i |d_i| |f_i*|.
"""

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import cross, difference, dot

CORNERS = 4
"""Corners of the support polygon."""


@kernel
def find_support(linkage, placement, contacts, corners):
    """Write the support polygon into corners (4, 3) [m], map frame.

    The order is counter-clockwise seen from above, from the rear right.
    """
    R, point, pivot = placement.R, contacts.point, placement.bogie_pivots
    for side in range(2):
        rear, rear_corner, front_corner = 3 * side, 3 * side, 1 + side
        on_rocker, behind, rocker_corner, bogie_corner = rear + 2, rear, front_corner, rear_corner
        if not linkage.on_bogie[rear]:
            on_rocker, behind = rear, rear + 1
            rocker_corner, bogie_corner = rear_corner, front_corner
        ahead = behind + 1
        arm_behind = R[0, 0] * (point[behind, 0] - pivot[side, 0])
        arm_behind += R[1, 0] * (point[behind, 1] - pivot[side, 1])
        arm_ahead = R[0, 0] * (point[ahead, 0] - pivot[side, 0])
        arm_ahead += R[1, 0] * (point[ahead, 1] - pivot[side, 1])
        share = min(max(-arm_behind / (arm_ahead - arm_behind), 0.0), 1.0)
        for i in range(3):
            step = point[ahead, i] - point[behind, i]
            corners[rocker_corner, i] = point[on_rocker, i]
            corners[bogie_corner, i] = point[behind, i] + share * step


@kernel
def tip_over_angles(corners, centre, force, moment):
    """Return the smallest tip-over angle [rad] and the smallest force-angle measure [N m].

    Args:
        corners: (k, 3) support polygon, counter-clockwise seen from above [m].
        centre: (3,) point where force and moment act, the centre of mass [m].
        force: (3,) net force on the rover without that of the ground: weight and tool force [N].
        moment: (3,) net moment about `centre` without that of the ground [N m].

    Both results are negative if the net force points outside the polygon.
    """
    smallest_angle = np.inf
    smallest_measure = np.inf
    count = corners.shape[0]
    for edge in range(count):
        angle, measure = measure_edge(corners, edge, centre, force, moment)
        smallest_angle = min(smallest_angle, angle)
        smallest_measure = min(smallest_measure, measure)
    return smallest_angle, smallest_measure


@kernel
def measure_edge(corners, edge, centre, force, moment):
    """Return tip-over angle [rad] and force-angle measure [N m] of one edge of the polygon.

    The edge is from corner `edge` to the next one. The other arguments are as for
    `tip_over_angles`.
    """
    start, end = corners[edge], corners[(edge + 1) % corners.shape[0]]
    side = difference(end, start)
    length = np.sqrt(dot(side, side))
    if not length > 0.0:
        return np.inf, np.inf
    axis = side[0] / length, side[1] / length, side[2] / length
    arm, (fx, fy, fz) = _normal_to(axis, difference(end, centre)), _normal_to(axis, force)
    square = dot(arm, arm)
    if not square > 0.0:
        return 0.0, 0.0
    about, (px, py, pz) = dot(axis, moment), cross(arm, axis)
    net = fx + about * px / square, fy + about * py / square, fz + about * pz / square
    size = np.sqrt(dot(net, net))
    if not size > 0.0:
        return np.inf, np.inf
    across = dot(axis, cross(net, arm))
    angle = np.arctan2(-across, dot(arm, net))
    distance = abs(across) / size
    return angle, angle * distance * size


@kernel
def _normal_to(axis, vector):
    """Return the component of a vector (3,) normal to a unit vector (3,)."""
    along = dot(axis, vector)
    return (
        vector[0] - along * axis[0],
        vector[1] - along * axis[1],
        vector[2] - along * axis[2],
    )
