# SPDX-License-Identifier: Apache-2.0
"""Steering: angle and rolling speed of each wheel for a planar motion, and when the rover drives.

A motion is (vx, vy, yaw rate) of the body origin on level ground, in the body frame, [m/s, rad/s].
The wheels are where they are on flat ground. A wheel at (x, y) then moves with (vx - rate y,
vy + rate x), across the line to the centre of rotation. A steered wheel points along this velocity
and may roll backwards, so its angle is within a quarter turn. A fixed wheel points ahead; it rolls
with the forward part of the velocity and skids with the rest.

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
from rover_physics.rover.model import Rover

ROUNDED_LIMIT = 1e-3
"""Excess of a steering angle over its limit [rad] that counts as rounding, as 1.57 for pi / 2."""
STILL = 1e-4
"""Velocity, or a component of it, over the largest that counts as zero: poses may be rounded to
1e-6 m, and a wheel beside or at the centre of a turn then points anywhere."""
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
        self._linkages: Any = array_of(pack_linkage(rover))
        self.steers = np.array(self._linkages["steers"][0], dtype=bool)
        """(6,) True for wheels that steer."""
        self._limit = float(self._linkages["steering_limit"][0])
        self._rate = float(self._linkages["steering_rate"][0])
        self._max_speed = rover.wheel.max_speed * rover.wheel.radius

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

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return a speed [m/s] and yaw rate [rad/s] at which no wheel exceeds its largest speed.

        Both are scaled by the same factor, so that the curvature stays.
        """
        if speed == yaw_rate == 0.0:
            return 0.0, 0.0
        fastest = float(np.abs(self.aim(speed, yaw_rate).speeds).max())
        share = self._max_speed / max(fastest, self._max_speed)
        return share * speed, share * yaw_rate

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


@kernel
def steer_wheels(linkage, motion, angles, rolling):
    """Write steering angles [rad] and rolling speeds [m/s] of the wheels for a motion.

    Args:
        linkage: LINKAGE.
        motion: (3,) vx, vy [m/s] and yaw rate [rad/s].
        angles: (6,) about the z axes of the links, positive to the left, written. Where a wheel
            cannot steer so far, the angle that it would need.
        rolling: (6,) speed of each wheel over the ground in its heading, negative backwards,
            written.

    Returns:
        Whether all wheels can follow. Without steering they can: the rover skids. With steering, a
        fixed wheel cannot follow a sideways motion of the body, but skids in curves.
    """
    vx, vy, rate = motion[0], motion[1], motion[2]
    if vy == 0.0 and rate == 0.0:
        for wheel in range(6):
            angles[wheel], rolling[wheel] = 0.0, vx
        return True
    can_follow = True
    fastest = fastest_wheel(linkage, motion)
    for wheel in range(6):
        x, y = linkage.wheels[wheel, 0], linkage.wheels[wheel, 1]
        ahead, aside = vx - rate * y, vy + rate * x
        angles[wheel], rolling[wheel] = 0.0, ahead
        if linkage.steers[wheel]:
            angle, limit = _angle_along(ahead, aside, fastest, vx), linkage.steering_limit
            if abs(angle) > limit:
                if abs(angle) > limit + ROUNDED_LIMIT:
                    can_follow = False
                else:
                    angle = limit if angle > 0.0 else -limit
            angles[wheel] = angle
            rolling[wheel] = ahead * np.cos(angle) + aside * np.sin(angle)
        elif vy != 0.0 and linkage.steering_limit > 0.0:
            angles[wheel] = _angle_along(vx, vy, fastest, vx)
            can_follow = False
    return can_follow


@kernel
def fastest_wheel(linkage, motion):
    """Return the largest speed [m/s] at which a motion moves a wheel over the ground."""
    fastest = 0.0
    for wheel in range(6):
        ahead = motion[0] - motion[2] * linkage.wheels[wheel, 1]
        aside = motion[1] + motion[2] * linkage.wheels[wheel, 0]
        fastest = max(fastest, np.hypot(ahead, aside))
    return fastest


@kernel
def _angle_along(ahead, aside, fastest, vx):
    """Return the angle [rad] of a wheel along a velocity, forwards or backwards; 0 at rest.

    A wheel that goes straight aside in a curve has the angle to which wider curves lead.
    """
    speed = np.hypot(ahead, aside)
    if not speed > STILL * fastest:
        return 0.0
    if abs(ahead) <= STILL * speed:
        is_mirrored = aside * vx < 0.0 and abs(vx) > STILL * fastest
        return -0.5 * np.pi if is_mirrored else 0.5 * np.pi
    return np.arctan(aside / ahead)
