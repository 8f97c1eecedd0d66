"""The loops around the shared torques: speed, heading, wheels that slip, and rate of change."""

from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.kernels import kernel

Floats = NDArray[np.float64]
OVERSPEED = 1.3
"""Rate of the wheels, over the wanted one, that is still taken for rolling."""
MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.2, 2.0
"""Bounds of a wheel's speed over the mean that rolling asks for."""
STALLED = 0.3
"""Share of the wanted rate below which the rover does not get on."""
STALL_TIME, STALL_DELAY, RECOVERY_TIME = 1.0, 0.5, 1.5
"""Time in which servos take over, in which they wait before (in the same), and let go [s]."""


@dataclass(frozen=True)
class LoopGains:
    """How hard the loops pull."""

    speed: float
    """Acceleration per error of speed [1/s]."""
    travel: float
    """Acceleration per error of way [1/s^2]."""
    heading: float
    """Angular acceleration per error of yaw rate [1/s]; that of the angle is a half of it."""
    slip: float
    """Torque per difference of a wheel's speed from that of rolling [N m s/rad]."""
    torque_rate: float
    """Largest change of a torque [N m/s]."""


class PIController:
    """Turns an error of speed into a push: proportional to it, and to the way it adds up to."""

    def __init__(self, gain: float, integral_gain: float, most: float):
        """Start at rest; `most` is the largest push and its largest integral part."""
        self._gain, self._integral_gain, self._most = gain, integral_gain, most
        self._integral = 0.0

    def reset(self) -> None:
        """Forget the way."""
        self._integral = 0.0

    def update(self, error: float, duration: float, limited: bool) -> float:
        """Return the push.

        Args:
            error: Wanted minus measured speed.
            duration: Since the last call [s].
            limited: Whether the last push could not be given; then it does not grow.
        """
        step = self._integral_gain * error * duration
        if not (limited and step * self._integral > 0.0):
            self._integral = self._limit(self._integral + step)
        return self._limit(self._gain * error + self._integral)

    def _limit(self, push: float) -> float:
        return min(max(push, -self._most), self._most)


class StallDetector:
    """Tells how far to give way to speed servos where the rover does not get on.

    A wheel that is stopped by a face it has not felt yet looks like one on level ground, and
    shares torque as such. Speed servos need not know: each pulls until its wheel turns.
    """

    def __init__(self) -> None:
        """Start with a rover that gets on."""
        self.share = 0.0

    def update(self, rate: float, wanted: float, duration: float) -> float:
        """Return the share of the servos, 0 to 1.

        Args:
            rate: Median rate of the wheels [rad/s]; those that spin raise their mean.
            wanted: The rate that is wanted of it [rad/s].
            duration: Since the last call [s].
        """
        stalled = wanted != 0.0 and rate / wanted < STALLED
        change = duration / (STALL_TIME if stalled else -RECOVERY_TIME)
        self.share = min(max(self.share + change, -STALL_DELAY), 1.0)
        return max(self.share, 0.0)


def rolling_rates(wheel_rates: Floats, ratios: Floats, wanted: float) -> Floats:
    """Return the rates (6,) at which the wheels would roll without slip.

    They go with the median of the measured ones: two wheels that spin do not move it.

    Args:
        wheel_rates: (6,) measured [rad/s].
        wanted: Mean that is wanted [rad/s]; rates far beyond it are those of wheels that slip.
        ratios: (6,) speeds of the wheels' centres, relative to their mean; a wheel that has to
            go backwards or far ahead is more likely one whose contact angle is wrong.
    """
    ratios = np.minimum(np.maximum(ratios, MIN_SPEED_RATIO), MAX_SPEED_RATIO)
    most = OVERSPEED * abs(wanted)
    return ratios * min(max(median((wheel_rates / ratios).tolist()), -most), most)


def limit_rate(torques: Floats, last: Floats, most: float) -> Floats:
    """Return torques (6,) that differ from the last by at most `most`, in the same direction.

    All changes are scaled alike, so that what the wheels share stays shared.
    """
    limited = np.empty(len(torques))
    _write_limited(torques, last, most, limited)
    return limited


@kernel
def _write_limited(torques, last, most, limited):
    largest = 0.0
    for wheel in range(len(torques)):
        largest = max(largest, abs(torques[wheel] - last[wheel]))
    share = 1.0 if largest <= most else most / largest
    for wheel in range(len(torques)):
        limited[wheel] = last[wheel] + share * (torques[wheel] - last[wheel])
