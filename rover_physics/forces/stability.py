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
    for side in range(2):
        _write_side(linkage, placement, contacts, side, corners)


@kernel
def _write_side(linkage, placement, contacts, side, corners):
    first = 3 * side
    point, pivot = contacts.point, placement.bogie_pivots
    rocker_is_rear = not linkage.on_bogie[first]
    on_rocker = first if rocker_is_rear else first + 2
    behind = first + 1 if rocker_is_rear else first
    ahead = behind + 1
    R = placement.R
    along_x, along_y = R[0, 0], R[1, 0]
    arm_behind = along_x * (point[behind, 0] - pivot[side, 0])
    arm_behind += along_y * (point[behind, 1] - pivot[side, 1])
    arm_ahead = along_x * (point[ahead, 0] - pivot[side, 0])
    arm_ahead += along_y * (point[ahead, 1] - pivot[side, 1])
    share = -arm_behind / (arm_ahead - arm_behind)
    share = min(max(share, 0.0), 1.0)
    rear = 0 if side == 0 else 3
    front = 1 if side == 0 else 2
    rocker_corner = rear if rocker_is_rear else front
    bogie_corner = front if rocker_is_rear else rear
    for i in range(3):
        corners[rocker_corner, i] = point[on_rocker, i]
        corners[bogie_corner, i] = point[behind, i] + share * (point[ahead, i] - point[behind, i])


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
