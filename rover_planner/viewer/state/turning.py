# SPDX-License-Identifier: Apache-2.0
"""Where turned wheels point in a state of the rover, and where its centre of rotation is."""

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.quaternions import matrix_from_xyzw, xyzw_from_rpy
from rover_physics.rover.model import Rover
from rover_planner.viewer.state.trajectory import RoverState

MAX_RADIUS = 8.0
"""Largest distance of the centre of rotation that is of interest [wheelbases]."""


def find_axles(rover: Rover, state: RoverState) -> Floats:
    """Return the directions (6, 3) of the axles, map frame, positive to the left."""
    R = matrix_from_xyzw(xyzw_from_rpy(*state.attitude))
    axles = np.empty((6, 3))
    for k, wheel in enumerate(WHEELS):
        side = k // 3
        link = state.rocker_angle[side]
        if not wheel.startswith(rover.suspension.rocker_wheel):
            link = link + state.bogie_angle[side]
        s, c = np.sin(state.steering_angle[k]), np.cos(state.steering_angle[k])
        axles[k] = R @ (-s * np.cos(link), c, s * np.sin(link))
    return axles


def find_turning_centre(rover: Rover, state: RoverState) -> Floats | None:
    """Return the centre of rotation (3,) [m] of the motion, map frame, at the wheels' height.

    None if the rover drives straight ahead, or almost.
    """
    vx, vy, rate = state.motion
    wheels = rover.suspension.wheels
    reach = MAX_RADIUS * (wheels["front"][0] - wheels["rear"][0])
    if not np.hypot(vx, vy) < reach * abs(rate):
        return None
    s, c = np.sin(state.attitude[2]), np.cos(state.attitude[2])
    x, y, _ = state.position
    height = float(state.contact_points[:, 2].mean())
    return np.array([x - (c * vy + s * vx) / rate, y + (c * vx - s * vy) / rate, height])
