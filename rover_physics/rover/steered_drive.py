# SPDX-License-Identifier: Apache-2.0
"""Steers wheels to a commanded motion: their angles, and when the rover may drive.

The rover drives on while its wheels are near their angles, slowed by the cosine of the largest
error, as the steering controllers of ros2_control do. If an error is larger, it stands and steers.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.names import WHEEL_COUNT, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of
from rover_physics.rover.linkage import pack_linkage
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.rover.steering import steer_wheels

STAND_ERROR = float(np.radians(20.0))
"""Error of a steering angle [rad] above which the rover stands while it steers."""


@dataclass(frozen=True, eq=False)
class WheelAims:
    """Angles and speeds of the wheels that a commanded motion asks for."""

    angles: Floats
    """(6,) steering angles within the limit [rad], positive to the left; 0 for fixed wheels."""
    speeds: Floats
    """(6,) rolling speeds along these headings [m/s], negative backwards."""
    refusal: str
    """Wheel and angle that the steering cannot reach; empty if the motion can be driven."""


class SteeredDrive:
    """Turns commands into steering angles and rolling speeds of one rover."""

    def __init__(self, rover: Rover):
        """Prepare for a rover; one without steering has all angles at 0 and skids in curves."""
        self._linkages: Any = array_of(pack_linkage(rover, *body_mass_and_com(rover)))
        self.steers = np.array(self._linkages["steers"][0], dtype=bool)
        """(6,) True for wheels that steer."""
        self._limit = float(self._linkages["steering_limit"][0])
        self._rate = float(self._linkages["steering_rate"][0])

    def aim(self, speed: float, yaw_rate: float) -> WheelAims:
        """Return what a speed ahead [m/s] and a yaw rate [rad/s] of the body origin ask for."""
        angles, speeds = np.empty(WHEEL_COUNT), np.empty(WHEEL_COUNT)
        motion = np.array([speed, 0.0, yaw_rate])
        if _aim(self._linkages, motion, angles, speeds):
            return WheelAims(angles, speeds, "")
        wheel = int(np.argmax(np.abs(angles)))
        needed, limit = np.degrees(angles[wheel]), np.degrees(self._limit)
        return WheelAims(
            np.clip(angles, -self._limit, self._limit),
            speeds,
            f"{WHEELS[wheel]} wheel needs a steering angle of {needed:.1f} deg; "
            f"the limit is {limit:.1f} deg",
        )

    def turn(self, angles: Floats, aims: Floats, duration: float) -> Floats:
        """Return angles (6,) [rad] after steering towards `aims` at the largest rate."""
        most = self._rate * duration
        return np.asarray(angles + np.clip(aims - angles, -most, most))

    def share(self, angles: Floats, aims: Floats) -> float:
        """Return the share of the commanded speed that is driven at angles (6,) [rad]."""
        error = float(np.abs(np.where(self.steers, aims - angles, 0.0)).max())
        return 0.0 if error > STAND_ERROR else float(np.cos(error))


@kernel
def _aim(linkages, motion, angles, speeds):
    """Write angles and speeds of `steer_wheels`; return whether all wheels can follow."""
    return steer_wheels(linkages[0], motion, angles, speeds)
