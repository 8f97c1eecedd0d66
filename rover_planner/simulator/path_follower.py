# SPDX-License-Identifier: Apache-2.0
"""Path following by pure pursuit and turns on the spot, with more tries where the rover stands."""

import math
from itertools import pairwise

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.angles import wrap
from rover_planner.planning.path_geometry import distance_along

ARRIVED = 0.02
"""Distance along the path from its end at which it is finished, in look-ahead distances."""
SAME_PLACE = 1e-4
"""Distance between poses up to which the path turns on the spot [m]."""
MIN_TURN = 1e-3
"""Smallest turn on the spot [rad]."""
ALIGNED = 0.01
"""Error of the heading at which a turn on the spot is finished [rad]."""
SLOW_ANGLE = 0.1
"""Error of the heading below which a turn on the spot becomes slower [rad]."""
MIN_TURN_SHARE = 0.2
"""Smallest share of the speed at the end of such a turn."""
PROGRESS, TURN_PROGRESS = 0.1, 0.02
"""Distance [wheel radii] and turn [rad] that count as progress."""
STUCK_TIME = 12.0
"""Time without progress [s] after which the rover stands still. The traction controller stops
pushing before that (`stall_time`), and pushes again after it was told to reverse."""
BACK_DISTANCE = 1.2
"""Distance by which the rover backs off [wheel radii]."""
BACK_TIME, BACK_DELAY = 6.0, 1.5
"""It backs off no longer than this time [s], or than the distance takes times the other."""
MAX_TRIES = 3
"""Attempts at one place."""
NEW_PLACE = 3.0
"""Distance along the path [wheel radii] after which the attempts are counted anew."""


class PathFollower:
    """Follows a path: stretches by pure pursuit, forwards or backwards, and turns on the spot.

    Source: Coulter, "Implementation of the pure pursuit path tracking algorithm", 1992.
    """

    def __init__(self, poses: Floats, look_ahead: float, outermost: float | None = None):
        """Follow poses (n, 3).

        Args:
            poses: (n, 3) x, y [m], yaw [rad].
            look_ahead: Look-ahead distance along the path [m].
            outermost: Distance of the outermost wheel from the body origin [m], which moves at the
                commanded speed in a turn on the spot (default: the look-ahead distance).
        """
        self._legs = _find_legs(np.asarray(poses, dtype=float))
        self._look_ahead = look_ahead
        self._outermost = look_ahead if outermost is None else outermost
        self._finished = 0.0

    @property
    def driven(self) -> float:
        """Distance driven along the path [m]."""
        return self._finished + self._legs[0].done

    def has_arrived(self, pose: Floats) -> bool:
        """Return whether a pose (3,) is at the end of the path."""
        left = ARRIVED * self._look_ahead
        return len(self._legs) == 1 and self._legs[0].is_done(pose, left)

    def steer(self, pose: Floats, speed: float) -> tuple[float, float]:
        """Return speed [m/s] and yaw rate [rad/s] at a pose (3,); zeros at the end."""
        self._legs[0].project(pose, self._look_ahead)
        while len(self._legs) > 1 and self._legs[0].is_done(pose, 1e-6):
            self._finished += self._legs.pop(0).length
            self._legs[0].project(pose, self._look_ahead)
        leg = self._legs[0]
        if self.has_arrived(pose):
            return 0.0, 0.0
        if leg.is_turn:
            left = leg.left_to_turn(pose)
            share = min(max(abs(left) / SLOW_ANGLE, MIN_TURN_SHARE), 1.0)
            return 0.0, math.copysign(share * speed / self._outermost, left)
        ahead = leg.at(leg.done + self._look_ahead) - pose[:2]
        # Backwards, the rover is steered as one that heads the other way.
        across = leg.gear * (-np.sin(pose[2]) * ahead[0] + np.cos(pose[2]) * ahead[1])
        curvature = 2.0 * across / max(float(ahead @ ahead), 1e-6)
        most = 1.0 / self._look_ahead
        return leg.gear * speed, speed * float(np.clip(curvature, -most, most))


class _Leg:
    """A stretch of a path, or a turn on the spot, with the distance that is done."""

    def __init__(self, poses: Floats):
        self._along = distance_along(poses)
        self.is_turn = len(poses) > 1 and bool((np.diff(self._along) <= SAME_PLACE).all())
        self.gear = -1.0 if _gears(poses).min(initial=0.0) < 0.0 else 1.0
        self._places = poses[:, :2]
        self._yaw = np.unwrap(poses[:, 2])
        self.length = 0.0 if self.is_turn else float(self._along[-1])
        self.done = 0.0
        self._seen = float(self._yaw[0])

    def is_done(self, pose: Floats, left: float) -> bool:
        """Return whether a pose is at the end of the leg, of a stretch up to `left` [m]."""
        if self.is_turn:
            return abs(self.left_to_turn(pose)) <= ALIGNED
        return self.done >= self.length - left

    def left_to_turn(self, pose: Floats) -> float:
        """Return the turn [rad] that is left, positive to the left; of large turns, too."""
        self._seen += math.remainder(float(pose[2]) - self._seen, 2.0 * math.pi)
        return float(self._yaw[-1] - self._seen)

    def project(self, pose: Floats, look_ahead: float) -> None:
        """Advance to the point of the leg nearest to the pose; never move backwards."""
        if self.is_turn:
            return
        ahead = np.linspace(self.done, min(self.done + look_ahead, self.length), 40)
        away = np.hypot(*(self.at(ahead) - pose[:2]).T)
        self.done = float(ahead[int(np.argmin(away))])

    def at(self, along: float | Floats) -> Floats:
        """Return the points (..., 2) at distances along the leg [m], extended straight on."""
        x, y = (np.interp(along, self._along, self._places[:, k]) for k in (0, 1))
        last = self._places[-1] - self._places[max(len(self._places) - 2, 0)]
        direction = last / max(float(np.hypot(*last)), 1e-9)
        over = np.maximum(along - self.length, 0.0)[..., None]
        return np.stack([x, y], axis=-1) + over * direction


def _find_legs(poses: Floats) -> list[_Leg]:
    """Return the legs of a path (n, 3): stretches in one gear, and turns on the spot."""
    changes = np.flatnonzero(np.diff(_gears(poses))) + 1
    bounds = [0, *changes.tolist(), len(poses) - 1]
    return [_Leg(poses[first : last + 1]) for first, last in pairwise(bounds)]


def _gears(poses: Floats) -> Floats:
    """Return 1 for steps (n - 1,) forwards, -1 for those backwards, 0 for turns on the spot."""
    steps = np.diff(poses, axis=0)
    turns = wrap(steps[:, 2])
    yaw = poses[:-1, 2] + 0.5 * turns
    ahead = steps[:, 0] * np.cos(yaw) + steps[:, 1] * np.sin(yaw)
    on_the_spot = (np.hypot(steps[:, 0], steps[:, 1]) <= SAME_PLACE) & (np.abs(turns) > MIN_TURN)
    return np.where(on_the_spot, 0.0, np.where(ahead < 0.0, -1.0, 1.0))


class SecondTry:
    """Follows a path; where the rover stands still it backs off and tries again.

    A wheel that has wedged at a face, or slips there, often climbs it from another position.
    """

    def __init__(
        self,
        follower: PathFollower,
        radius: float,
        max_tries: int = MAX_TRIES,
        patience: float = STUCK_TIME,
    ):
        """Follow the path of a follower.

        Args:
            follower: Follows the path.
            radius: Wheel radius [m].
            max_tries: Attempts at one place. With one attempt, a rover that stands still goes on
                trying.
            patience: Time without progress after which the rover stands still [s]; longer for a
                rover that stands while its wheels steer.
        """
        self._follower, self._radius = follower, radius
        self._max_tries, self._patience = max_tries, patience
        self._seen, self._since = (math.inf, math.inf, 0.0), 0.0
        """Pose and time of the last progress."""
        self._tries, self._counted_from = 1, 0.0
        self._back_from, self._back_until = self._seen, -math.inf
        """Pose from which the rover backs off, and the time up to which it does [s]."""
        self.retries = 0
        """Number of times that the rover has backed off."""

    @property
    def given_up(self) -> bool:
        """True if the rover stood still in its last attempt."""
        return self._tries > self._max_tries > 1

    def has_arrived(self, pose: Floats) -> bool:
        """Return whether a pose (3,) is at the end of the path."""
        return self._follower.has_arrived(pose)

    def steer(self, pose: Floats, speed: float, now: float) -> tuple[float, float]:
        """Return speed [m/s] and yaw rate [rad/s] at a pose (3,) and time `now` [s].

        Zeros at the end of the path and after the last attempt.
        """
        wanted, radius = self._follower.steer(pose, speed), self._radius
        x, y, yaw = (float(value) for value in pose)
        backs_off = now < self._back_until
        if backs_off and math.dist((x, y), self._back_from[:2]) < BACK_DISTANCE * radius:
            return -speed, 0.0
        moved = math.dist((x, y), self._seen[:2]) > PROGRESS * radius
        turned = abs(math.remainder(yaw - self._seen[2], 2.0 * math.pi)) > TURN_PROGRESS
        if backs_off or moved or turned:
            self._seen, self._since, self._back_until = (x, y, yaw), now, -math.inf
        if self._follower.driven > self._counted_from + NEW_PLACE * radius:
            self._counted_from, self._tries = self._follower.driven, 1
        if any(wanted) and now - self._since > self._patience:
            self._tries, self._since = self._tries + 1, now
            if self._tries <= self._max_tries:
                self.retries += 1
                needed = BACK_DISTANCE * radius / speed
                self._back_from = x, y, yaw
                self._back_until = now + max(BACK_TIME, BACK_DELAY * needed)
        return (0.0, 0.0) if self.given_up else wanted
