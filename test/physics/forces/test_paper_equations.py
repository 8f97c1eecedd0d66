# SPDX-License-Identifier: Apache-2.0
"""Equations (1) and (3) to (7) of the paper hold on settled poses, to rounding error.

The paper: Hacot, Dubowsky and Bidaud, "Analysis and Simulation of a Rocker-Bogie Exploration
Rover". Misprints are mended as docs/physics.md lists them. (2), a wheel on the ground, is in
test_settling.py; (8) to (15), in 3-D and with all weights, are the nine sums of
test_equilibrium.py.
"""

import numpy as np

from rover_physics import PathPrediction, Rover, judge_path
from support.grounds import fractal, random_poses, rocky, smooth
from support.rover_geometry import attitude_of
from support.rovers import LSR1


def link_of(start, end) -> tuple[float, float]:
    """Return length and elevation of a link between two points of the body's plane."""
    along, up = end[0] - start[0], end[2] - start[2]
    return np.hypot(along, up), np.arctan2(up, along)


def closure(rover: Rover, prediction: PathPrediction, i: int) -> dict:
    """Return what is left of eqs (1) and (3) to (7), by their numbers [rad, m].

    The paper's roll is the camber of the wheels, positive when the right side is high; its link
    angles are elevations in the plane of the wheels. The symbols are those of docs/physics.md.
    """
    suspension = rover.suspension
    l1, gamma = link_of(suspension.rocker_pivot, suspension.wheels["rear"])
    l2, bogie = link_of(suspension.rocker_pivot, suspension.bogie_pivot)
    l3, middle = link_of(suspension.bogie_pivot, suspension.wheels["middle"])
    l4, front = link_of(suspension.bogie_pivot, suspension.wheels["front"])
    alpha, beta = bogie - gamma, front - middle
    R = attitude_of(prediction, i)
    nose_up, roll = np.arctan2(R[2, 0], R[2, 2]), -np.arcsin(R[2, 1])
    rockers = nose_up - prediction.rocker_angle[i]
    theta1, theta3 = gamma + rockers
    theta2, theta4 = middle + rockers - prediction.bogie_angle[i]
    z1r, z2r, z3r, z1l, z2l, z3l = prediction.wheel_centres[i, :, 2]
    c, s = np.cos(roll), np.sin
    across = 2.0 * suspension.rocker_pivot[1] * s(roll)
    to_pivot = l3 * s(theta2) + l2 * s(theta1 + alpha)
    to_left_bogie = to_pivot - l2 * s(theta3 + alpha)
    return {
        1: (theta1 + theta3) / 2.0 - gamma - nose_up,
        3: z2r - z3r - c * (l3 * s(theta2) - l4 * s(theta2 + beta)),
        4: z2r - z1r - c * (to_pivot - l1 * s(theta1)),
        5: z2r - z1l - c * (to_pivot - l1 * s(theta3)) - across,
        6: z2r - z2l - c * (to_left_bogie - l3 * s(theta4)) - across,
        7: z2r - z3l - c * (to_left_bogie - l4 * s(theta4 + beta)) - across,
    }


def test_eqs_1_and_3_to_7_hold_in_3d_wherever_the_rover_settles():
    grounds, poses = [make(11) for make in (smooth, fractal, rocky)], random_poses(2, 30, 0.5)
    for prediction in [judge_path(LSR1, ground, poses)[0] for ground in grounds]:
        for i in np.flatnonzero(prediction.settled):
            assert max(map(abs, closure(LSR1, prediction, i).values())) <= 1e-12
