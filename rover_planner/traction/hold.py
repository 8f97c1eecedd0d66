# SPDX-License-Identifier: Apache-2.0
"""Torques of a rover that does not drive: held by its servos, braked or left to coast.

- hold: each wheel has a PI servo to a rate of zero. It starts from the torques that balance the
  weight along the slope, so the rover does not roll first. It needs fresh wheel rates; without
  them the torques are zero and the brake is applied.
- brake: zero torques, the brake is applied.
- coast: zero torques, the brake is released. On a slope the rover rolls.
"""

import math

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.traction.settings import TractionSettings

RATE_GAIN = 10.0
"""Angular deceleration per wheel rate of the hold servo [1/s]."""
ANGLE_GAIN = 25.0
"""Angular deceleration per angle turned of the hold servo [1/s^2]."""
MAX_STEP = 0.1
"""Upper bound of the time step of the servo [s]."""


class HoldServo:
    """Holds the wheels at rest by torque."""

    def __init__(self, settings: TractionSettings, weight: float):
        """Start without torque.

        Args:
            settings: Rover and largest torque.
            weight: Weight with payload [N].
        """
        self._integral = np.zeros(WHEEL_COUNT)
        self.configure(settings, weight)

    def configure(self, settings: TractionSettings, weight: float) -> None:
        """Take new settings; the torques go on from the last ones."""
        radius = settings.rover.wheel.radius
        self._inertia = weight / settings.rover.gravity * radius**2 / WHEEL_COUNT
        self._torque_of_weight = weight * radius / WHEEL_COUNT
        self._max_torque = settings.max_torque

    def start(self, pitch: float) -> None:
        """Start from the torques that balance the weight on a slope.

        Args:
            pitch: Pitch of the body [rad], positive with the nose down.
        """
        self._integral[:] = -self._torque_of_weight * math.sin(pitch)

    def update(self, wheel_rates: Floats, duration: float) -> Floats:
        """Return the torques (6,) [N m] that stop and hold wheels of measured rates [rad/s]."""
        duration = min(duration, MAX_STEP)
        self._integral -= ANGLE_GAIN * self._inertia * duration * wheel_rates
        np.clip(self._integral, -self._max_torque, self._max_torque, out=self._integral)
        torques = self._integral - RATE_GAIN * self._inertia * wheel_rates
        return np.clip(torques, -self._max_torque, self._max_torque)
