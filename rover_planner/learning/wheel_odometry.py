# SPDX-License-Identifier: Apache-2.0
"""Odometry from wheels and an IMU that knows how wheels slip, with a covariance; without ROS.

Wheels under load creep: forward by a share of their way that grows with the slope, and down a side
slope. How much is learned wherever the motion is measured without the wheels, piece by piece of
way, and taken off where it is not. The misses that are left are the noise of the odometry.
"""

import math
from dataclasses import dataclass

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.learning.wheel_slip import LONGEST_GAP
from rover_planner.planning.angles import wrap

FORWARD_PRIOR, SIDE_PRIOR = (0.03, 0.2), (0.2,)
"""Standard deviations before anything was learned: of the share of way that is lost everywhere,
of that per slope, and of the way aside per side slope."""
MISS, MISS_COUNT = 0.03, 4.0
"""Standard deviation of the miss of a piece over its way, and for how many pieces it counts."""
GYRO_NOISE, GYRO_BIAS = 2e-3, 1e-4
"""Noise of the yaw rate [rad/sqrt(s)], and its unknown bias [rad/s]."""
LIMIT = 4
"""Power of used over known friction by which wheels begin to slide."""
MOST_SLIDE = 1.0
"""Standard deviation of the way over the way where all friction is used."""


class Regression:
    """Bayes' linear regression with unknown noise and rare large misses."""

    def __init__(self, prior: tuple[float, ...]):
        """Start with parameters that are 0 but for standard deviations."""
        self._rest = np.diag(np.square(np.reciprocal(prior)))
        self._squares, self._products = np.zeros_like(self._rest), np.zeros(len(prior))
        self._count, self._sum = MISS_COUNT, MISS_COUNT * MISS**2
        self._solve()

    def add(self, inputs: Floats, value: float) -> None:
        """Take a value that is the inputs (n,) times the parameters, but for noise."""
        miss = value - float(inputs @ self.mean)
        self._count, self._sum = self._count + 1.0, self._sum + miss**2
        weight = 1.0 / (1.0 + (miss / (2.0 * MISS)) ** 2)  # a wheel that spins is no creep
        self._squares += weight * np.outer(inputs, inputs)
        self._products += weight * value * inputs
        self._solve()

    def _solve(self) -> None:
        """Find the parameters from what was taken."""
        self.variance = self._sum / self._count
        """Variance of the noise."""
        self.covariance: Floats = np.linalg.inv(self._squares / self.variance + self._rest)
        """Covariance (n, n) of the parameters."""
        self.mean: Floats = self.covariance @ self._products / self.variance
        """Means (n,) of the parameters."""


@dataclass(frozen=True)
class WheelMotion:
    """Measurements of wheels and IMU at one time."""

    time: float
    """Time [s]."""
    rates: Floats
    """(6,) wheel rates [rad/s]; NaN where none was measured."""
    steering: Floats
    """(6,) steering angles [rad]."""
    roll: float
    pitch: float
    """Attitude [rad]."""
    yaw_rate: float
    """Rate of the yaw [rad/s]."""


class WheelOdometry:
    """The odometry of one rover, from where it starts."""

    def __init__(self, rover: Rover):
        """Start at 0 with slip that is not known."""
        places = np.array([rover.suspension.wheels[name] for name in ("rear", "middle", "front")])
        self._x = np.tile(places[:, 0], 2)
        self._y = np.repeat([-1.0, 1.0], 3) * np.tile(places[:, 1], 2)
        self._radius, self._piece = rover.wheel.radius, 0.5 * rover.wheelbase
        self.forward, self.side = Regression(FORWARD_PRIOR), Regression(SIDE_PRIOR)
        """Shares of the distance lost ahead and gone aside; may be those of another drive."""
        self.friction = rover.friction
        """Friction of the ground, as far as it is known."""
        self.pose = np.zeros(3)
        """x, y [m] and yaw [rad] from where it started."""
        self.speed = 0.0
        """Speed ahead [m/s]."""
        self.speed_deviation = 0.0
        """Standard deviation of it [m/s]."""
        self._last: WheelMotion | None = None
        self._sums = np.zeros(15)
        self._forward_ways, self._noise = self._sums[:8].reshape(2, 2, 2)
        self._side_way, self._slide = self._sums[8:12].reshape(2, 2)
        self._piece_ways, self._way, self._elapsed = self._sums[12:], 0.0, 0.0
        self._begin: Floats | None = None

    def take(self, motion: WheelMotion) -> None:
        """Go on by a measurement."""
        last, self._last = self._last, motion
        elapsed = 0.0 if last is None else motion.time - last.time
        if last is None or not 0.0 < elapsed < LONGEST_GAP:
            return
        ahead = self._find_speeds(motion)
        if not len(ahead):
            return
        # Plain numbers and one sum: arrays of two elements take several times as long.
        slope, aside = -math.tan(motion.pitch), math.tan(motion.roll)
        raw = float(ahead.sum()) / len(ahead) * math.cos(motion.pitch)
        step = raw * elapsed
        # Slip grows with the load on the wheels against the motion, so with the slope ahead.
        uphill = slope if raw > 0.0 else -slope
        everywhere, per_slope = self.forward.mean.tolist()
        lost, drift = everywhere + per_slope * uphill, float(self.side.mean[0]) * aside
        used = min(math.hypot(slope, aside) / max(self.friction, 1e-3), 1.0)
        slide = MOST_SLIDE * used**LIMIT
        self.speed = raw * (1.0 - lost)
        along = float(self.forward.variance)
        across = float(self.side.variance) * (aside**2 + 1.0)
        self.speed_deviation = abs(raw) * math.hypot(math.sqrt(along), slide)
        self.pose[2] += 0.5 * elapsed * (motion.yaw_rate + last.yaw_rate)
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        self.pose[0] += step * ((1.0 - lost) * c + drift * s)
        self.pose[1] += step * ((1.0 - lost) * s - drift * c)
        piece = math.copysign(self._piece, step)
        mixed = piece * (along - across) * c * s
        ahead_noise = piece * (along * c**2 + across * s**2)
        aside_noise = piece * (along * s**2 + across * c**2)
        self._sums += step * np.array([
            c, c * uphill, s, s * uphill,  # forward ways
            ahead_noise, mixed, mixed, aside_noise,
            -s * aside, c * aside, c * slide, s * slide,  # way aside, slide
            1.0, uphill, aside,  # ways of the piece
        ])  # fmt: skip
        self._elapsed += elapsed
        self._way += abs(step)

    def _find_speeds(self, motion: WheelMotion) -> Floats:
        """Return the speeds of the body [m/s] that the wheels tell, those that were measured."""
        c, s = np.cos(motion.steering), np.sin(motion.steering)
        turning = motion.yaw_rate
        ahead = (self._radius * motion.rates - turning * self._x * s) / c + turning * self._y
        return np.asarray(ahead[np.isfinite(ahead)])

    def learn(self, pose: Floats) -> None:
        """Take a pose (3,) that was not measured by the wheels: x, y [m], yaw [rad]."""
        if self._begin is None or self._way > self._piece:
            if self._begin is not None and np.isfinite(pose).all():
                self._learn_piece(self._begin, pose)
            self._begin, self._way = np.array(pose), 0.0
            self._piece_ways[:] = 0.0

    def _learn_piece(self, begin: Floats, end: Floats) -> None:
        """Learn from a piece of way between two measured poses."""
        step, yaw = end[:2] - begin[:2], begin[2] + 0.5 * float(wrap(end[2] - begin[2]))
        ahead = float(step @ [np.cos(yaw), np.sin(yaw)])
        left = float(step @ [-np.sin(yaw), np.cos(yaw)])
        ways = self._piece_ways / self._way
        if abs(ways[0]) > 0.9:  # it did not go back and forth
            self.forward.add(ways[:2], ways[0] - ahead / self._way)
            self.side.add(ways[2:], -left / self._way)

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the pose."""
        yaw = GYRO_NOISE**2 * self._elapsed + (GYRO_BIAS * self._elapsed) ** 2
        across = np.array([-self.pose[1], self.pose[0]])
        result = np.zeros((3, 3))
        result[:2, :2] = (
            self._noise
            + self._forward_ways @ self.forward.covariance @ self._forward_ways.T
            + self.side.covariance[0, 0] * np.outer(self._side_way, self._side_way)
            + np.outer(self._slide, self._slide)
            + yaw / 3.0 * np.outer(across, across)
        )
        result[2, 2] = yaw
        result[2, :2] = result[:2, 2] = 0.5 * yaw * across
        return result
