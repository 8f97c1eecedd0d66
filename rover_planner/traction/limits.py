# SPDX-License-Identifier: Apache-2.0
"""Limits of what a rover can measure.

A measurement outside these limits comes from a broken sensor or driver, not from a rover.
"""

import math
from collections.abc import Mapping

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import steering_joints

MAX_WHEEL_RATE_RATIO = 20.0
"""Largest possible wheel rate, over the drive's largest; a rover that rolls down a slope is
faster than its drives."""
MAX_TURNING_RATE = 20.0
"""Largest possible rate of the body, a rocker or a bogie [rad/s]."""
ANGLE_MARGIN = 0.5
"""Angle beyond the limit of a suspension or steering joint that is possible [rad]."""


class MeasurementLimits:
    """The limits of one rover; bad measurements are described, good ones give an empty text."""

    def __init__(self, rover: Rover):
        """Take the limits from a rover."""
        suspension, wheel = rover.suspension, rover.wheel
        fastest = MAX_WHEEL_RATE_RATIO * wheel.max_speed
        self._rates = dict.fromkeys(SUSPENSION_JOINTS, (-MAX_TURNING_RATE, MAX_TURNING_RATE))
        self._rates |= dict.fromkeys(WHEEL_JOINTS, (-fastest, fastest))
        self._angles = {
            name: suspension.rocker_limits if "rocker" in name else suspension.bogie_limits
            for name in SUSPENSION_JOINTS
        }
        if rover.steering is not None:
            limit = rover.steering.limit
            self._angles |= dict.fromkeys(steering_joints(rover), (-limit, limit))

    def find_wrong_joint(
        self, positions: Mapping[str, float], velocities: Mapping[str, float]
    ) -> str:
        """Describe an impossible angle [rad] or rate [rad/s] of a joint of the rover."""
        for kind, unit, values, bounds, margin in (
            ("position", "rad", positions, self._angles, ANGLE_MARGIN),
            ("velocity", "rad/s", velocities, self._rates, 0.0),
        ):
            for name, value in values.items():
                low, high = bounds.get(name, (-math.inf, math.inf))
                if not low - margin <= value <= high + margin:
                    return (
                        f"joint_states has {kind} {value:g} of {name}; it must be in "
                        f"{low - margin:g} to {high + margin:g} {unit}"
                    )
        return ""

    def find_wrong_rates(self, rates: Floats | None) -> str:
        """Describe an impossible angular velocity (3,) of the body [rad/s]."""
        if rates is None or all(abs(rate) <= MAX_TURNING_RATE for rate in rates.tolist()):
            return ""
        return (
            f"imu has angular velocity {rates.tolist()}; it must be within "
            f"{MAX_TURNING_RATE:g} rad/s"
        )
