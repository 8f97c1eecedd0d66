# SPDX-License-Identifier: Apache-2.0
"""The directions in which the wheels roll with their measured steering angles, and their speeds.

The loops of the controller know one speed: the mean speed of the wheels, positive in their
`directions`. Wheels straight ahead all have direction 1. Each wheel has the direction in which it
rolls while the others go on as before, so a slow turn of the steering never reverses the loops.
"""

from typing import Any

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.steered_drive import SteeredDrive

TURN_LEFT = np.repeat([1.0, -1.0], 3)
"""Signs (6,) of wheel torques that turn the rover left: the right wheels drive forward."""
MIN_ALIGNED = 2.0
"""Sum of the products of old and new directions from which on the motion counts as the same."""


class WheelCourse:
    """The rolling of the wheels at the last update, and the wanted speeds."""

    def __init__(self, rover: Rover):
        """Start with wheels straight ahead."""
        self._drive = SteeredDrive(rover)
        self._half_track = rover.suspension.wheels["middle"][1]
        self._steered = rover.steering is not None
        self._turned = False
        self._speeds = np.ones(WHEEL_COUNT)
        self._yaw_per_speed = 0.0
        self._arms = np.zeros(WHEEL_COUNT)
        self.directions = np.ones(WHEEL_COUNT)
        """(6,) 1 where a wheel rolls forward, -1 where backward, for a positive mean speed."""
        self.sign = 1.0
        """Sign of the mean speed over that of the rolling motion of the balance."""

    def take(self, rolling: Any, angles: Floats) -> bool:
        """Take a ROLLING at measured angles (6,) [rad]; return False for a new motion.

        The motion is new after a change such as that from straight ahead to a turn on the spot.
        """
        self._turned = bool(angles.any())
        aligned = float(self.directions @ rolling.directions)
        self.sign = -1.0 if self._turned and aligned < 0.0 else 1.0
        self.directions = self.sign * rolling.directions
        self._speeds = self.sign * rolling.speeds
        self._yaw_per_speed = self.sign * float(rolling.motion[2])
        self._arms = rolling.arms
        return self.sign * aligned >= MIN_ALIGNED

    @property
    def ratios(self) -> Floats:
        """(6,) speeds of the wheels in their directions on level ground, over their mean."""
        return self.directions * self._speeds

    def mean_of(self, rates: Floats) -> float:
        """Return the mean of wheel rates (6,) in the wheels' directions."""
        return float((self.directions * rates).sum()) / WHEEL_COUNT

    def want(self, command: tuple[float, float], angles: Floats) -> tuple[float, Floats]:
        """Return the wanted mean speed [m/s] and speeds of the wheels (6,) [m/s].

        Args:
            command: Speed ahead [m/s] and yaw rate [rad/s].
            angles: (6,) measured steering angles [rad].
        """
        speed, yaw_rate = command
        if not self._steered:
            turning = yaw_rate * self._half_track
            return speed, np.repeat([speed + turning, speed - turning], 3)
        aims = self._drive.aim(speed, yaw_rate)
        if aims.refusal:
            return 0.0, np.zeros(WHEEL_COUNT)
        speeds = self._drive.share(angles, aims.angles) * aims.speeds
        return self.mean_of(speeds), speeds

    def steering_aims(self, command: tuple[float, float]) -> Floats | None:
        """Return the angles [rad] of the steered wheels for a command, positive to the left.

        None if wheels do not steer, the command is to stand, or no angles follow it: the steering
        stays as it is.
        """
        if not self._steered or not any(command):
            return None
        aims = self._drive.aim(*command)
        return None if aims.refusal else aims.angles[self._drive.steers]

    def describe_refusal(self, command: tuple[float, float]) -> str:
        """Return why the steering cannot follow a command; empty if it can."""
        return self._drive.aim(*command).refusal if self._steered else ""

    def yaw_rate(self, wanted: float, mean_speed: float) -> float:
        """Return the yaw rate [rad/s] of the heading loop.

        Wheels that steer decide about the yaw rate, so the loop only keeps them from sliding.

        Args:
            wanted: Commanded yaw rate [rad/s], which rovers with fixed wheels follow by skidding.
            mean_speed: Measured mean speed of the wheels [m/s].
        """
        return self._yaw_per_speed * mean_speed if self._steered else wanted

    @property
    def turning_shares(self) -> Floats:
        """(6,) tractions per moment about body z [1/m] that do not drive the rover on."""
        if not self._turned:
            return TURN_LEFT / (WHEEL_COUNT * self._half_track)
        arms, speeds = self._arms, self._speeds
        across = arms - float(arms @ speeds) / float(speeds @ speeds) * speeds
        return np.asarray(across / float(arms @ arms))
