# SPDX-License-Identifier: Apache-2.0
"""Path following that backs off and tries again where the rover stands still."""

import math

from rover_physics.numerics.arrays import Floats
from rover_planner.simulator.path_follower import PathFollower

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
