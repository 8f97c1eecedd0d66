# SPDX-License-Identifier: Apache-2.0
"""Control loops around the torque allocation: speed, heading, slip, stall and torque rate."""

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

from rover_physics.names import SUSPENSION_JOINTS, WHEEL_COUNT
from rover_physics.numerics.arrays import Floats

MAX_PUSH = 0.6
"""Largest push of the speed loop, as a share of the rover's weight."""
HEADING_INTEGRAL_GAIN = 0.5
"""Integral gain of the heading loop over its gain [1/s]."""
MAX_RATE_RATIO = 1.3
"""Largest median wheel rate, over the wanted rate, that counts as rolling without slip."""
MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.2, 2.0
"""Bounds of the speed of a wheel's centre, over the mean of all wheels."""
STALL_RATIO = 0.3
"""Share of the wanted rate below which the rover counts as stalled."""
SLOW_SHARE = 0.1
"""Share of the fastest wanted rate below which a wheel tells nothing about a stall."""
NOT_BLOCKED = np.zeros(WHEEL_COUNT)
STALL_DELAY = 0.5
"""Delay between stall and takeover by the speed servos, in units of TAKEOVER_TIME."""
MAP_STALL_DELAY = 2.5
"""The same if the contact angles come from a map: the program may need that time for a face."""
STALLED_GROWTH = 2.0
"""Growth of the push of a stalled rover, over that of one that moves."""
TAKEOVER_TIME = 1.0
"""Time in which the share of the speed servos rises from 0 to 1 [s]."""
SERVO_TIME = 3.5
"""Time after which servos in vain leave the torques to the program again, with its delay [s]."""
CLIMBING_ANGLE = 0.02
"""Change of a suspension angle that shows that the rover climbs, however slowly [rad]."""
RELEASE_TIME = 1.5
"""Time in which their share falls from 1 to 0 when the rover moves again [s]."""
SERVO_INTEGRAL_GAIN = 5.0
"""Integral gain of the speed servos of a stalled rover, over their gain [1/s]."""
MAX_PEAK = 0.95
"""Peak friction utilisation above which the push falls: beyond it wheels slip."""
FALL_TIME, REGROWTH_TIME = 0.1, 0.5
"""Time constants with which the largest push falls and grows again [s]."""
MIN_PUSH_SHARE = 1e-3
"""Lower bound of the largest push, over its upper bound, from where it grows again."""
SPEED_TIME, LONGEST_GAP = 0.5, 1.0
"""Time over which the measured speed is averaged, and without positions before it begins anew [s]:
wheels that hop move the body to and fro."""


class PIController:
    """PI controller of a speed error, with limited output and anti-windup."""

    def __init__(self, gain: float, integral_gain: float, limit: float):
        """Start with an integral part of zero.

        Args:
            gain: Output per error.
            integral_gain: Output per integral of the error over time in [s].
            limit: Largest magnitude of the output, and of its integral part.
        """
        self._gain, self._integral_gain, self._limit = gain, integral_gain, limit
        self.start()

    def start(self, integral: float = 0.0) -> None:
        """Start with an integral part; that of another controller makes a smooth change."""
        self.integral = self._clip(integral)
        """The integral part of the output."""

    def update(self, error: float, duration: float, limited: bool) -> float:
        """Return the output.

        Args:
            error: Wanted minus measured speed.
            duration: Time since the last call [s].
            limited: Whether the last output was not fully applied; the integral then does not
                grow.
        """
        step = self._integral_gain * error * duration
        if not (limited and step * self.integral > 0.0):
            self.integral = self._clip(self.integral + step)
        return self._clip(self._gain * error + self.integral)

    def _clip(self, output: float) -> float:
        return min(max(output, -self._limit), self._limit)


class PushLoop(PIController):
    """The speed loop: the push that the wheels' travel asks for, within what the ground takes.

    The program answers a push that is too large with wheels beyond their friction. More push does
    not help then: the wheels slip, and the one at a face loses the force that presses it on. The
    largest push that the wheels can give without slip is found by trying.
    """

    def start(self, integral: float = 0.0) -> None:
        """Start with an integral part [N], and allow the largest push."""
        super().start(integral)
        self._allowed, self._cut = self._limit, False

    def push(self, error: float, duration: float, limited: bool, peak: float) -> float:
        """Return the push [N].

        Args:
            error: Wanted minus measured speed [m/s].
            duration: Time since the last call [s].
            limited: As for `update`.
            peak: Peak friction utilisation with the last push.
        """
        wanted = self.update(error, duration, limited or self._cut)
        change = duration / (-FALL_TIME if peak > MAX_PEAK else REGROWTH_TIME)
        allowed = self._allowed * max(1.0 + change, 0.0)
        self._allowed = min(max(allowed, MIN_PUSH_SHARE * self._limit), self._limit)
        within = min(max(wanted, -self._allowed), self._allowed)
        self._cut = within != wanted
        return within


@dataclass(frozen=True, eq=False)
class WheelRates:
    """Measured and wanted motion of the wheels, each in the direction in which it rolls."""

    rates: Floats
    """(6,) measured rates [rad/s]."""
    ratios: Floats
    """(6,) speeds of the wheels' centres over their mean."""
    suspension_angles: Floats
    """(4,) angles of rockers and bogies [rad]."""
    wanted: float
    """Wanted mean rate [rad/s]."""
    from_map: bool
    """True if the ratios come from a map; from motion they may miss a face."""
    level_ratios: Floats
    """(6,) speeds of the wheels over their mean on level ground, 1 straight ahead."""
    progress: float = 1.0
    """Measured speed of the body over the wanted one; 1 where it is not known."""


class BodySpeed:
    """The mean speed of the body from measured positions."""

    def __init__(self) -> None:
        """Start without positions."""
        self._time, self._place, self._velocity = -np.inf, np.zeros(2), np.zeros(2)
        self._since = -np.inf

    def take(self, place: Floats, time: float) -> None:
        """Take a position (2,) [m] at a time [s]."""
        elapsed = time - self._time
        if 0.0 < elapsed < LONGEST_GAP:
            velocity = (place - self._place) / elapsed
            self._velocity += min(elapsed / SPEED_TIME, 1.0) * (velocity - self._velocity)
        elif elapsed != 0.0:
            self._velocity, self._since = np.zeros(2), time
        self._time, self._place = time, np.array(place)

    @property
    def speed(self) -> float:
        """Speed [m/s]; NaN before positions of SPEED_TIME."""
        known = self._time - self._since > SPEED_TIME
        return float(np.hypot(*self._velocity)) if known else math.nan


class StallDetector:
    """Computes the share of speed servos in the torques of a stalled rover.

    A rover is stalled if its wheels stand, or turn while its body stands.

    A wheel at a steep face whose contact angle is not estimated yet gets only the small torque of
    a wheel on level ground. Speed servos need no contact angles: each increases its torque until
    its wheel turns.
    """

    def __init__(self) -> None:
        """Start with a share of 0, as for a rover that moves."""
        self._share, self._servo_time = 0.0, 0.0
        self._seen = np.zeros(len(SUSPENSION_JOINTS))
        self.stalled = False
        """True if the rover was stalled at the last update."""
        self.climbs = False
        """True if the suspension has moved by CLIMBING_ANGLE with the last update."""

    def update(self, motion: WheelRates, duration: float) -> float:
        """Return the share of the speed servos, 0 to 1.

        Args:
            motion: How the wheels move. The median of their rates counts, because spinning wheels
                would raise a mean; and the suspension angles, which change while one wheel climbs
                a steep face and the others hardly turn.
            duration: Time since the last call [s].
        """
        delay = MAP_STALL_DELAY if motion.from_map else STALL_DELAY
        rate = median(motion.rates.tolist())
        progress = min(rate / motion.wanted, motion.progress) if motion.wanted else 1.0
        self.stalled = progress < STALL_RATIO
        change = duration / (TAKEOVER_TIME if self.stalled else -RELEASE_TIME)
        self._share = min(max(self._share + change, -delay), 1.0)
        moved = np.abs(motion.suspension_angles - self._seen).max()
        self.climbs = bool(moved > CLIMBING_ANGLE)
        if self.climbs:
            self._seen = motion.suspension_angles.copy()
            self._share = self._share if self._share > 0.0 else -delay
        self._servo_time = self._servo_time + duration if self._share == 1.0 else 0.0
        if self._servo_time > SERVO_TIME:
            self._share = -delay
        return max(self._share, 0.0)


class WheelServos:
    """Speed servos of all wheels: PI controllers whose integral part is a limited torque."""

    def __init__(self, gain: float, integral_gain: float, max_torque: float):
        """Start with an integral of zero.

        Args:
            gain: Torque per error of a wheel's rate [N m s/rad]. A servo that is stiffer than the
                wheel's inertia over the period allows makes a slipping wheel oscillate.
            integral_gain: Torque per error of a wheel's angle [N m/rad].
            max_torque: Largest magnitude of the integral part [N m].
        """
        self._gain, self._integral_gain, self._max_torque = gain, integral_gain, max_torque
        self.integral = np.zeros(WHEEL_COUNT)
        """Integral part (6,) of the torques [N m]."""

    def start(self, torques: Floats) -> None:
        """Go on from torques (6,) [N m]."""
        self.integral = np.minimum(np.maximum(torques, -self._max_torque), self._max_torque)

    def update(self, errors: Floats, duration: float) -> Floats:
        """Return torques (6,) [N m] for errors (6,) of the rates [rad/s] over a time [s]."""
        self.start(self.integral + self._integral_gain * duration * errors)
        return self._gain * errors + self.integral


class SlipControl:
    """Adds torques against slip, and those of speed servos if the rover is stalled."""

    def __init__(self, gain: float, max_torque: float):
        """Start as for a rover that moves.

        Args:
            gain: Torque per difference between a wheel's rate and that of rolling [N m s/rad].
            max_torque: Largest torque of a wheel [N m].
        """
        self._gain = gain
        self._servos = WheelServos(gain, SERVO_INTEGRAL_GAIN * gain, max_torque)
        self.detector = StallDetector()
        """Tells whether the rover is stalled or climbs."""

    def correct(self, torques: Floats, motion: WheelRates, duration: float) -> Floats:
        """Return torques (6,) [N m] with slip control.

        Args:
            torques: (6,) torques of the other loops [N m].
            motion: How the wheels move.
            duration: Time since the last call [s].
        """
        torques = torques - self._gain * _find_slip(motion)
        share = self.detector.update(motion, duration)
        if share == 0.0:
            self._servos.start(torques)
            return torques
        wanted = motion.wanted * motion.level_ratios
        servo = self._servos.update(wanted - motion.rates, duration)
        return torques + share * (servo - torques)


def _find_slip(motion: WheelRates) -> Floats:
    """Return the differences (6,) between the wheels' rates and those of rolling [rad/s].

    While one wheel climbs a steep face, the median rate is about zero and would call that wheel
    slipping. With a map, a wheel whose rate fits the motion of all wheels is not.
    """
    rates, ratios = motion.rates, motion.ratios
    slip = rates - estimate_rolling_rates(rates, ratios, motion.wanted)
    if not motion.from_map:
        return slip
    other = rates - ratios * float(ratios @ rates) / float(ratios @ ratios)
    return np.where(np.abs(other) < np.abs(slip), other, slip)


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
    change = torques - last
    largest = float(np.abs(change).max())
    share = 1.0 if largest <= max_change else max_change / largest
    return last + share * change


class StallWatch:
    """Counts the time without progress; stalled until the command is zero or reverses."""

    def __init__(self) -> None:
        """Start with a rover that moves."""
        self._time = 0.0
        self._blocked = NOT_BLOCKED

    def reset_time(self) -> None:
        """Start to count anew, for a rover that climbs."""
        self._time = 0.0

    def update(self, rates: Floats, wanted: Floats, duration: float, stall_time: float) -> bool:
        """Return whether the rover is stalled.

        Args:
            rates: (6,) wheel rates [rad/s].
            wanted: (6,) wanted rates of the wheels [rad/s].
            duration: Time since the last call [s].
            stall_time: Time without progress after which the rover is stalled [s].
        """
        if float(wanted @ self._blocked) > 0.0:
            return True
        self._blocked = NOT_BLOCKED
        if not wanted.any():
            self._time = 0.0
            return False
        stands = _find_progress(rates, wanted) < STALL_RATIO
        self._time = max(self._time + (duration if stands else -duration), 0.0)
        if self._time < stall_time:
            return False
        self._time, self._blocked = 0.0, wanted
        return True


def _find_progress(rates: Floats, wanted: Floats) -> float:
    """Return the median of the wheels' rates over their wanted rates."""
    slowest = SLOW_SHARE * float(np.abs(wanted).max())
    pairs = zip(rates.tolist(), wanted.tolist(), strict=True)
    return median([rate / own for rate, own in pairs if abs(own) > slowest])
