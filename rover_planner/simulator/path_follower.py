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
NO_PLACE = (math.inf, math.inf)


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
        self._at, self._finished = 0, 0.0

    @property
    def driven(self) -> float:
        """Distance driven along the path [m]."""
        return self._finished + self._leg.done

    @property
    def _leg(self) -> "_Leg":
        return self._legs[self._at]

    @property
    def _is_last(self) -> bool:
        return self._at == len(self._legs) - 1

    def has_arrived(self, pose: Floats) -> bool:
        """Return whether a pose (3,) is at the end of the path."""
        return self._is_last and self._is_done(pose)

    def steer(self, pose: Floats, speed: float) -> tuple[float, float]:
        """Return speed [m/s] and yaw rate [rad/s] at a pose (3,); zeros at the end."""
        self._leg.project(pose, self._look_ahead)
        while not self._is_last and self._is_done(pose):
            self._finished += self._leg.length
            self._at += 1
            self._leg.project(pose, self._look_ahead)
        if self.has_arrived(pose):
            return 0.0, 0.0
        if self._leg.is_turn:
            return 0.0, self._turn(pose, speed)
        target = self._leg.at(self._leg.done + self._look_ahead)
        ahead, gear = target - pose[:2], self._leg.gear
        # Backwards, the rover is steered as one that heads the other way.
        across = gear * (-np.sin(pose[2]) * ahead[0] + np.cos(pose[2]) * ahead[1])
        curvature = 2.0 * across / max(float(ahead @ ahead), 1e-6)
        most = 1.0 / self._look_ahead
        return gear * speed, speed * float(np.clip(curvature, -most, most))

    def _is_done(self, pose: Floats) -> bool:
        """Return whether a pose is at the end of the current leg."""
        leg = self._leg
        if leg.is_turn:
            return abs(leg.left_to_turn(pose)) <= ALIGNED
        left = ARRIVED * self._look_ahead if self._is_last else 1e-6
        return leg.done >= leg.length - left

    def _turn(self, pose: Floats, speed: float) -> float:
        """Return the yaw rate [rad/s] of a turn on the spot."""
        left = self._leg.left_to_turn(pose)
        share = min(max(abs(left) / SLOW_ANGLE, MIN_TURN_SHARE), 1.0)
        return math.copysign(share * speed / self._outermost, left)


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
        self._place, self._yaw, self._since = NO_PLACE, 0.0, 0.0
        self._tries, self._counted_from = 1, 0.0
        self._back_from, self._back_until = NO_PLACE, -math.inf
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
        wanted = self._follower.steer(pose, speed)
        if self._backs_off(pose, now):
            return -speed, 0.0
        self._note_progress(pose, now)
        if any(wanted) and now - self._since > self._patience:
            self._try_again(pose, speed, now)
        return (0.0, 0.0) if self.given_up else wanted

    def _try_again(self, pose: Floats, speed: float, now: float) -> None:
        """Begin to back off at a speed [m/s], unless this was the last attempt."""
        self._tries += 1
        self._since = now
        if self._tries <= self._max_tries:
            self.retries += 1
            needed = BACK_DISTANCE * self._radius / speed
            self._back_from = _place_of(pose)
            self._back_until = now + max(BACK_TIME, BACK_DELAY * needed)

    def _backs_off(self, pose: Floats, now: float) -> bool:
        """Return whether the rover still backs off; at the end, count its time anew."""
        if now >= self._back_until:
            return False
        if math.dist(_place_of(pose), self._back_from) < BACK_DISTANCE * self._radius:
            return True
        self._back_until = -math.inf
        self._note(pose, now)
        return False

    def _note(self, pose: Floats, now: float) -> None:
        """Note a pose and its time [s] as progress."""
        self._place, self._yaw, self._since = _place_of(pose), float(pose[2]), now

    def _note_progress(self, pose: Floats, now: float) -> None:
        """Note where the rover is if it has moved or turned."""
        turned = abs(math.remainder(float(pose[2]) - self._yaw, 2.0 * math.pi))
        moved = math.dist(_place_of(pose), self._place)
        if moved > PROGRESS * self._radius or turned > TURN_PROGRESS:
            self._note(pose, now)
        if self._follower.driven > self._counted_from + NEW_PLACE * self._radius:
            self._counted_from, self._tries = self._follower.driven, 1


def _place_of(pose: Floats) -> tuple[float, float]:
    return float(pose[0]), float(pose[1])
