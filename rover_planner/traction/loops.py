"""Control loops around the torque allocation: speed, heading, slip, stall and torque rate."""

from dataclasses import dataclass
from statistics import median

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel

MAX_RATE_RATIO = 1.3
"""Largest median wheel rate, over the wanted rate, that counts as rolling without slip."""
MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.2, 2.0
"""Bounds of the speed of a wheel's centre, over the mean of all wheels."""
STALL_RATIO = 0.3
"""Share of the wanted rate below which the rover counts as stalled."""
STALL_DELAY = 0.5
"""Delay between stall and takeover by the speed servos, in units of TAKEOVER_TIME."""
TAKEOVER_TIME = 1.0
"""Time in which the share of the speed servos rises from 0 to 1 [s]."""
RELEASE_TIME = 1.5
"""Time in which their share falls from 1 to 0 when the rover moves again [s]."""


@dataclass(frozen=True)
class LoopGains:
    """Gains of the loops."""

    speed: float
    """Acceleration per error of speed [1/s]."""
    travel: float
    """Acceleration per error of distance travelled [1/s^2]."""
    heading: float
    """Angular acceleration per error of yaw rate [1/s]; the integral gain is half of it."""
    slip: float
    """Torque per difference between wheel rate and rolling rate [N m s/rad]."""
    torque_rate: float
    """Largest rate of change of a torque [N m/s]."""


class PIController:
    """PI controller of a speed error, with limited output and anti-windup."""

    def __init__(self, gain: float, integral_gain: float, limit: float):
        """Start with an integral of zero.

        Args:
            gain: Output per error.
            integral_gain: Output per integral of the error over time in [s].
            limit: Largest magnitude of the output, and of its integral part.
        """
        self._gain, self._integral_gain, self._limit = gain, integral_gain, limit
        self._integral = 0.0

    def reset(self) -> None:
        """Set the integral to zero."""
        self._integral = 0.0

    @property
    def integral(self) -> float:
        """The integral part of the output; one from another controller makes a smooth change."""
        return self._integral

    @integral.setter
    def integral(self, integral: float) -> None:
        self._integral = self._clip(integral)

    def update(self, error: float, duration: float, limited: bool) -> float:
        """Return the output.

        Args:
            error: Wanted minus measured speed.
            duration: Time since the last call [s].
            limited: Whether the last output was not fully applied; the integral then does not
                grow.
        """
        step = self._integral_gain * error * duration
        if not (limited and step * self._integral > 0.0):
            self._integral = self._clip(self._integral + step)
        return self._clip(self._gain * error + self._integral)

    def _clip(self, output: float) -> float:
        return min(max(output, -self._limit), self._limit)


class StallDetector:
    """Computes the share of speed servos in the torques of a stalled rover.

    A wheel at a steep face whose contact angle is not estimated yet gets only the small torque of
    a wheel on level ground. Speed servos need no contact angles: each increases its torque until
    its wheel turns.
    """

    def __init__(self) -> None:
        """Start with a share of 0, as for a rover that moves."""
        self._share = 0.0

    def update(self, rate: float, wanted: float, duration: float) -> float:
        """Return the share of the speed servos, 0 to 1.

        Args:
            rate: Median wheel rate [rad/s]; spinning wheels would raise a mean.
            wanted: Wanted wheel rate [rad/s].
            duration: Time since the last call [s].
        """
        stalled = wanted != 0.0 and rate / wanted < STALL_RATIO
        change = duration / (TAKEOVER_TIME if stalled else -RELEASE_TIME)
        self._share = min(max(self._share + change, -STALL_DELAY), 1.0)
        return max(self._share, 0.0)


def estimate_rolling_rates(wheel_rates: Floats, ratios: Floats, wanted: float) -> Floats:
    """Return the rates (6,) at which the wheels would roll without slip.

    They are based on the median of the measured rates, which two spinning wheels do not change.

    Args:
        wheel_rates: (6,) measured rates [rad/s].
        ratios: (6,) speeds of the wheels' centres over their mean. Ratios outside the bounds
            probably come from a wrong contact angle and are clipped.
        wanted: Wanted mean rate [rad/s]; the median is limited to MAX_RATE_RATIO times it.
    """
    ratios = np.minimum(np.maximum(ratios, MIN_SPEED_RATIO), MAX_SPEED_RATIO)
    limit = MAX_RATE_RATIO * abs(wanted)
    return ratios * min(max(median((wheel_rates / ratios).tolist()), -limit), limit)


def limit_rate(torques: Floats, last: Floats, max_change: float) -> Floats:
    """Return torques (6,) that differ from the last by at most `max_change` [N m].

    All changes are scaled by the same factor, which keeps their ratios.
    """
    limited = np.empty(len(torques))
    _write_limited(torques, last, max_change, limited)
    return limited


@kernel
def _write_limited(torques, last, max_change, limited):
    """Write the torques of `limit_rate` into `limited` (6,)."""
    largest = 0.0
    for wheel in range(len(torques)):
        largest = max(largest, abs(torques[wheel] - last[wheel]))
    share = 1.0 if largest <= max_change else max_change / largest
    for wheel in range(len(torques)):
        limited[wheel] = last[wheel] + share * (torques[wheel] - last[wheel])
