# SPDX-License-Identifier: Apache-2.0
"""Steering: angle and rolling speed of each wheel that a planar motion of the body asks for.

A motion is (vx, vy, yaw rate) of the body origin on level ground, in the body frame, [m/s, rad/s].
The wheels are where they are on flat ground. A wheel at (x, y) then moves with (vx - rate y,
vy + rate x), across the line to the centre of rotation. A steered wheel points along this velocity
and may roll backwards, so its angle is within a quarter turn. A fixed wheel points ahead; it rolls
with the forward part of the velocity and skids with the rest.
"""

import numpy as np

from rover_physics.numerics.kernels import kernel

ROUNDED_LIMIT = 1e-3
"""Excess of a steering angle over its limit [rad] that counts as rounding, as 1.57 for pi / 2."""
STILL = 1e-9
"""Velocity, or a component of it, over the largest that counts as zero."""


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
            angle, limit = _angle_along(ahead, aside, fastest), linkage.steering_limit
            if abs(angle) > limit:
                if abs(angle) > limit + ROUNDED_LIMIT:
                    can_follow = False
                else:
                    angle = limit if angle > 0.0 else -limit
            angles[wheel] = angle
            rolling[wheel] = ahead * np.cos(angle) + aside * np.sin(angle)
        elif vy != 0.0 and linkage.steering_limit > 0.0:
            angles[wheel] = _angle_along(vx, vy, fastest)
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
def _angle_along(ahead, aside, fastest):
    """Return the angle [rad] of a wheel along a velocity, forwards or backwards; 0 at rest."""
    speed = np.hypot(ahead, aside)
    if not speed > STILL * fastest:
        return 0.0
    if abs(ahead) <= STILL * speed:
        return 0.5 * np.pi
    return np.arctan(aside / ahead)
