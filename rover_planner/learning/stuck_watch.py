# SPDX-License-Identifier: Apache-2.0
"""Notices that a rover is stuck: its wheels push or spin, and it does not move."""

from collections import deque
from datetime import UTC, datetime

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.learning.drive_log import TIME, YAW, X, Y
from rover_planner.learning.wheel_slip import LONGEST_GAP, SlipWindow, find_median
from rover_planner.planning.marked_places import MarkedPlace

NO_PROGRESS = 0.10
"""Way over that of the treads below which a rover that rolls does not get on."""
SLOWEST = 0.1
"""Speed of the treads, over the rover's nominal speed, that counts as rolling."""
PUSHING = 0.9
"""Torque over the largest one of a motor that pushes as hard as it can."""
CLIMBING = 0.01
"""Change of a suspension angle over a window that shows that a wheel climbs [rad]."""
PATIENCE = 1.2
"""Time without progress after which the rover counts as stuck, beyond half a window [s]."""


class StuckWatch:
    """Counts the time without progress of one rover."""

    def __init__(self, nominal_speed: float, max_torque: float):
        """Start with a rover that moves.

        Args:
            nominal_speed: Speed of the rover [m/s].
            max_torque: Largest torque of a motor [N m].
        """
        self._slowest = SLOWEST * nominal_speed
        self._most = PUSHING * max_torque
        self._past: deque[tuple[float, Floats, Floats, Floats, bool]] = deque()
        self.reason = ""
        """Reason why the rover is stuck; empty if it is not."""

    def update(
        self,
        window: SlipWindow,
        torques: Floats,
        climb: float,
        commanded: float | None = None,
    ) -> bool:
        """Return whether the rover is stuck at the end of a window.

        Args:
            window: What the wheels did.
            torques: (6,) mean torques [N m].
            climb: Largest change of a suspension angle over the window, beyond its noise [rad].
            commanded: Commanded speed [m/s], None if it is not known: then wheels that turn, or
                push as hard as they can, tell that the rover is to move.
        """
        free = np.maximum(np.abs(window.rolling) - window.scrub, 0.0)
        wanted = bool((np.abs(torques) >= self._most).sum() >= WHEEL_COUNT // 3)
        if commanded is not None:
            wanted = abs(commanded) > self._slowest
        holds_steering = bool(window.scrub.max() < self._slowest)
        wanted = wanted and holds_steering  # while it steers, it stands
        past = self._past
        if past and not 0.0 <= window.time - past[-1][0] <= LONGEST_GAP:
            past.clear()
        direction = np.sign(window.rolling)
        advance, rolling = direction * window.travel, direction * free
        past.append((window.time, window.places, advance, rolling, wanted))
        while len(past) > 1 and window.time - past[1][0] >= PATIENCE - 1e-6:
            past.popleft()
        times, places, advances, speeds, wishes = zip(*past, strict=True)
        elapsed = times[-1] - times[0]
        self.reason = ""
        if elapsed >= PATIENCE - 1e-6 and climb < CLIMBING:
            # On the spot the middle of the wheels stays, and each goes its way.
            moved = float(np.hypot(*(places[-1] - places[0]).T).mean()) / elapsed
            rolling = find_median(np.abs(speeds))
            # There and back a rover rolls and stays, too: what counts is where it rolls to.
            rolled = float(find_median(np.abs(np.mean(speeds, axis=0))))
            turns = rolling.max() > self._slowest
            stays = moved < (NO_PROGRESS * rolled if turns else self._slowest)
            # One that slides back moves and does not get on.
            stays |= turns and float(np.mean(advances)) < -NO_PROGRESS * rolled
            if stays and rolling.min() > self._slowest:
                self.reason = "wheels turn and the rover stays"
            elif stays and all(wishes):  # wheels that push may begin to spin
                self.reason = "wheels push and the rover stays"
        return bool(self.reason)


def find_place_ahead(rover: Rover, row: Floats, rolling: float, reason: str) -> MarkedPlace:
    """Return the place that a stuck rover cannot pass: half a wheelbase, its rim at the body.

    Args:
        rover: The rover.
        row: What was measured last, as in `drive_log`; its time is that of the epoch.
        rolling: Speed at which the wheels roll; below 0 the disc is behind the rover.
        reason: Why it is stuck.
    """
    radius = 0.5 * rover.wheelbase
    ahead = np.copysign(radius, rolling)
    x = float(row[X] + ahead * np.cos(row[YAW]))
    y = float(row[Y] + ahead * np.sin(row[YAW]))
    date = datetime.fromtimestamp(float(row[TIME]), UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return MarkedPlace(round(x, 3), round(y, 3), round(radius, 3), f"{reason} there", date)
