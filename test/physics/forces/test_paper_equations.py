# SPDX-License-Identifier: Apache-2.0
"""Equations (1) and (3) to (7) of the paper hold on settled poses, to rounding error.

The paper: Hacot, Dubowsky and Bidaud, "Analysis and Simulation of a Rocker-Bogie Exploration
Rover". Misprints are mended as docs/physics.md lists them. (2), a wheel on the ground, is in
test_rough_poses.py; (8) to (15), in 3-D and with all weights, are the nine sums of
test_equilibrium.py.
"""

from typing import NamedTuple

import numpy as np

from rover_physics import PathPrediction, Rover, judge_path
from support.rough_grounds import fractal, random_poses, rocky, smooth
from support.rover_geometry import attitude_of
from support.rovers import LSR1


class Links(NamedTuple):
    """The paper's lengths and angles of a rover with the bogie ahead, see docs/physics.md."""

    l1: float
    l2: float
    l3: float
    l4: float
    alpha: float
    beta: float
    gamma: float
    middle: float
    """Elevation of the middle wheel from the bogie pivot on flat ground [rad]."""
    w: float


def links_of(rover: Rover) -> Links:
    def link(start, end):
        along, up = end[0] - start[0], end[2] - start[2]
        return np.hypot(along, up), np.arctan2(up, along)

    suspension = rover.suspension
    l1, rear = link(suspension.rocker_pivot, suspension.wheels["rear"])
    l2, bogie = link(suspension.rocker_pivot, suspension.bogie_pivot)
    l3, middle = link(suspension.bogie_pivot, suspension.wheels["middle"])
    l4, front = link(suspension.bogie_pivot, suspension.wheels["front"])
    w = 2.0 * suspension.rocker_pivot[1]
    return Links(l1, l2, l3, l4, bogie - rear, front - middle, rear, middle, w)


def closure(rover: Rover, prediction: PathPrediction, i: int) -> dict:
    """Return what is left of eqs (1) and (3) to (7), by their numbers [rad, m].

    The paper's roll is the camber of the wheels, positive when the right side is high; its link
    angles are elevations in the plane of the wheels.
    """
    k = links_of(rover)
    R = attitude_of(prediction, i)
    nose_up, roll = np.arctan2(R[2, 0], R[2, 2]), -np.arcsin(R[2, 1])
    rockers = nose_up - prediction.rocker_angle[i]
    theta1, theta3 = k.gamma + rockers
    theta2, theta4 = k.middle + rockers - prediction.bogie_angle[i]
    z1r, z2r, z3r, z1l, z2l, z3l = prediction.wheel_centres[i, :, 2]
    c, s = np.cos(roll), np.sin
    across = k.w * s(roll)
    to_pivot = k.l3 * s(theta2) + k.l2 * s(theta1 + k.alpha)
    to_left_bogie = to_pivot - k.l2 * s(theta3 + k.alpha)
    return {
        1: (theta1 + theta3) / 2.0 - k.gamma - nose_up,
        3: z2r - z3r - c * (k.l3 * s(theta2) - k.l4 * s(theta2 + k.beta)),
        4: z2r - z1r - c * (to_pivot - k.l1 * s(theta1)),
        5: z2r - z1l - c * (to_pivot - k.l1 * s(theta3)) - across,
        6: z2r - z2l - c * (to_left_bogie - k.l3 * s(theta4)) - across,
        7: z2r - z3l - c * (to_left_bogie - k.l4 * s(theta4 + k.beta)) - across,
    }


def test_eqs_1_and_3_to_7_hold_in_3d_wherever_the_rover_settles():
    grounds, poses = [make(11) for make in (smooth, fractal, rocky)], random_poses(2, 30, 0.5)
    for prediction in [judge_path(LSR1, ground, poses)[0] for ground in grounds]:
        for i in np.flatnonzero(prediction.settled):
            assert max(map(abs, closure(LSR1, prediction, i).values())) <= 1e-12
