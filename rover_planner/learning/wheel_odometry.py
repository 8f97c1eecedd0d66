# SPDX-License-Identifier: Apache-2.0
"""Odometry from wheels and an IMU that knows how wheels slip, with a covariance; without ROS.

Wheels under load creep: forward by a share of their distance that grows with what they push, and
down a side slope. How much is learned wherever the motion is measured without the wheels, piece by
piece of the path, and taken off where it is not. The misses that are left are the noise of the
odometry.

Wheels that need all friction slide: a rover that pushes against an obstacle stands, and its wheels
turn on. Their torques tell how much they push, and the ground's friction how much they can.
"""

import math

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.angles import wrap
from rover_planner.learning.drive_log import PITCH, RATES, ROLL, STEERING, TIME, TORQUES
from rover_planner.learning.friction_filter import PRIOR_SPREAD
from rover_planner.learning.wheel_health import WheelHealth
from rover_planner.learning.wheel_slip import LONGEST_GAP

FORWARD_PRIOR, SIDE_PRIOR = (0.03, 0.2), (0.2,)
"""Standard deviations before anything was learned: of the share of the distance that is lost
everywhere, of that per push, and of the distance aside per side slope."""
MISS, MISS_COUNT = 0.03, 4.0
"""Standard deviation of the miss of a piece over its length, and for how many pieces it counts."""
GYRO_NOISE, GYRO_BIAS = 2e-3, 1e-4
"""Noise of the yaw rate [rad/sqrt(s)], and its unknown bias [rad/s]."""
HALF_SLIDE, SLIDE_SPREAD = 0.85, 0.1
"""Use of friction at which wheels that slide lose half of the distance, and the standard deviation
of its logarithm."""
SIDE_SLIDE = 0.25
"""Distance aside over the distance that wheels roll while they slide, on any ground: a face that
the rover meets askew pushes it aside."""
JUMP = 2.0
"""Distance of two poses over the way that the wheels rolled from which a pose has jumped."""
TRACTION_TIME = 0.5
"""Time over which the traction is averaged [s]: it jumps where wheels hop."""


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
        self._per_torque = len(self._x) / (rover.wheel.radius * rover.weight)
        self._health = WheelHealth(rover)
        self.friction, self.friction_deviation = rover.friction, PRIOR_SPREAD * rover.friction
        """Friction of the ground, as far as it is known, and its standard deviation."""
        self._traction = 0.0
        """What all wheels pull, over the weight; without torques that is the slope."""
        self.pose = np.zeros(3)
        """x, y [m] and yaw [rad] from where it started."""
        self.speed = 0.0
        """Speed ahead [m/s]."""
        self.speed_deviation = 0.0
        """Standard deviation of it [m/s]."""
        self.time, self.yaw_rate = math.nan, math.nan
        """Time [s] and yaw rate [rad/s] of the last row; NaN before the first."""
        # How far an error of 1 has moved the place, x and y [m]: of the two shares that are lost
        # ahead, of that gone aside, of the slides ahead and aside.
        self._shifts, self._noise = np.zeros((5, 2)), np.zeros((2, 2))
        self._elapsed = self._distance = 0.0
        # Of a piece: the distance that it rolled, times push, times side slope [m].
        self._rolled = self._pushed = self._leaned = 0.0
        self._begin: Floats | None = None

    def take(self, row: Floats, yaw_rate: float) -> None:
        """Go on by a row of measurements and the yaw rate [rad/s] at its time.

        A torque or rate that is frozen, and a torque that no motor has, count as not measured.
        """
        row = self._health.clean(row)
        self._health.take(row)
        row = self._health.drop_frozen(row)
        ahead = self._find_speeds(row, yaw_rate)
        if not len(ahead):
            return
        elapsed, self.time = float(row[TIME]) - self.time, float(row[TIME])
        turned, self.yaw_rate = 0.5 * elapsed * (yaw_rate + self.yaw_rate), yaw_rate
        if not 0.0 < elapsed < LONGEST_GAP:
            self._begin = None  # how far the wheels rolled meanwhile is not known
            return
        # Plain numbers and few sums: arrays of two elements take several times as long.
        pitch = float(row[PITCH])
        slope, aside = -math.tan(pitch), math.tan(row[ROLL])
        raw = float(ahead.sum()) / len(ahead) * math.cos(pitch)
        torques = row[TORQUES][np.isfinite(row[TORQUES])]
        pull = float(torques.sum()) / len(torques) * self._per_torque if len(torques) else slope
        self._traction += min(elapsed / TRACTION_TIME, 1.0) * (pull - self._traction)
        push = self._traction if raw > 0.0 else -self._traction
        slid, slide, slide_aside = self._find_slide(push, aside)
        rolled = (1.0 - slid) * raw
        way, step = raw * elapsed, rolled * elapsed
        everywhere, per_push = self.forward.mean.tolist()
        lost, drift = everywhere + per_push * push, float(self.side.mean[0]) * aside
        self.speed = rolled * (1.0 - lost)
        along = float(self.forward.variance)
        across = float(self.side.variance) * (aside**2 + 1.0)
        self.speed_deviation = math.hypot(rolled * math.sqrt(along), raw * slide)
        self.pose[2] += turned
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        self.pose[0] += step * ((1.0 - lost) * c + drift * s)
        self.pose[1] += step * ((1.0 - lost) * s - drift * c)
        self._shifts += np.array([
            [c * step, s * step],
            [c * push * step, s * push * step],
            [-s * aside * step, c * aside * step],
            [slide * c * way, slide * s * way],
            [-slide_aside * s * way, slide_aside * c * way],
        ])  # fmt: skip
        piece = math.copysign(self._piece, step)
        mixed = piece * (along - across) * c * s
        ahead_noise = piece * (along * c**2 + across * s**2)
        aside_noise = piece * (along * s**2 + across * c**2)
        self._noise += step * np.array([[ahead_noise, mixed], [mixed, aside_noise]])
        self._elapsed += elapsed
        self._distance += abs(step)
        self._rolled += step
        self._pushed += step * push
        self._leaned += step * aside

    def _find_slide(self, push: float, aside: float) -> tuple[float, float, float]:
        """Return the share of the distance that sliding wheels lose, and its standard deviation.

        The share is that at the known friction, whose error is in the deviation. The third number
        is the standard deviation of the share that they go aside, where the ground falls: what
        has no friction left slides there.

        Args:
            push: What all wheels pull in the direction of the motion, over the weight.
            aside: Slope to the side.
        """
        friction = max(self.friction, 1e-3)
        spread = math.hypot(SLIDE_SPREAD, self.friction_deviation / friction)
        likely = _chance_to_slide(push / friction, SLIDE_SPREAD)
        demand = math.hypot(push, aside)
        possible = _chance_to_slide(demand / friction, spread)
        deviation = math.sqrt((possible - likely) ** 2 + possible * (1.0 - possible))
        share = max(SIDE_SLIDE, abs(aside) / max(demand, 1e-9))
        return likely, deviation, math.copysign(possible * share, aside)

    def _find_speeds(self, row: Floats, turning: float) -> Floats:
        """Return the speeds of the body [m/s] that the wheels tell, those that were measured.

        `turning` is the yaw rate [rad/s]. Wheels whose steering is not measured point ahead.
        """
        steering = np.where(np.isnan(row[STEERING]), 0.0, row[STEERING])
        c, s = np.cos(steering), np.sin(steering)
        ahead = (self._radius * row[RATES] - turning * self._x * s) / c + turning * self._y
        return np.asarray(ahead[np.isfinite(ahead)])

    def learn(self, pose: Floats) -> None:
        """Take a pose (3,) that was not measured by the wheels: x, y [m], yaw [rad]."""
        if self._begin is None or self._distance > self._piece:
            if self._begin is not None and np.isfinite(pose).all():
                self._learn_piece(self._begin, pose)
            self._begin, self._distance = np.array(pose), 0.0
            self._rolled = self._pushed = self._leaned = 0.0

    def _learn_piece(self, begin: Floats, end: Floats) -> None:
        """Learn from a piece of the path between two measured poses."""
        step, yaw = end[:2] - begin[:2], begin[2] + 0.5 * float(wrap(end[2] - begin[2]))
        ahead = float(step @ [np.cos(yaw), np.sin(yaw)])
        left = float(step @ [-np.sin(yaw), np.cos(yaw)])
        distances = np.array([self._rolled, self._pushed, self._leaned]) / self._distance
        jumped = math.hypot(*step) > JUMP * self._distance
        if abs(distances[0]) > 0.9 and not jumped:  # it did not go back and forth
            self.forward.add(distances[:2], distances[0] - ahead / self._distance)
            self.side.add(distances[2:], -left / self._distance)

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the pose."""
        yaw = GYRO_NOISE**2 * self._elapsed + (GYRO_BIAS * self._elapsed) ** 2
        across = np.array([-self.pose[1], self.pose[0]])
        forward, side, slides = self._shifts[:2], self._shifts[2], self._shifts[3:]
        result = np.zeros((3, 3))
        result[:2, :2] = (
            self._noise
            + forward.T @ self.forward.covariance @ forward
            + self.side.covariance[0, 0] * np.outer(side, side)
            + slides.T @ slides
            + yaw / 3.0 * np.outer(across, across)
        )
        result[2, 2] = yaw
        result[2, :2] = result[:2, 2] = 0.5 * yaw * across
        return result


def _chance_to_slide(used: float, spread: float) -> float:
    """Return the chance that wheels slide at a use of friction, if its logarithm has a spread."""
    if not used > 0.0:
        return 0.0
    return 0.5 * math.erfc(math.log(HALF_SLIDE / used) / (math.sqrt(2.0) * spread))
