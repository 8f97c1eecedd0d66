# SPDX-License-Identifier: Apache-2.0
"""Notices that a rover is stuck: its wheels push or spin, and it does not move."""

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.learning.wheel_slip import SlipWindow

NO_PROGRESS = 0.10
"""Travel over rolling of the median wheel below which a rover that rolls does not get on."""
SLOWEST = 0.1
"""Speed of the treads, over the rover's nominal speed, that counts as rolling."""
PUSHING = 0.9
"""Torque over the largest one of a motor that pushes as hard as it can."""
CLIMBING = 0.01
"""Change of a suspension angle over a window that shows that a wheel climbs [rad]."""
PATIENCE = 0.8
"""Time without progress after which the rover counts as stuck, beyond that of a window [s]."""


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
        self._time = 0.0
        self._last = -np.inf
        self.reason = ""
        """Why the rover is stuck; empty if it is not."""

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
        pushed = np.sign(window.rolling)
        speed = float(np.median(np.abs(window.rolling)))
        travel = abs(float(np.median(window.travel * pushed)))
        noise = 2.0 * window.deviation
        spins = speed > max(self._slowest, noise) and travel < NO_PROGRESS * speed + noise
        pushes = np.abs(torques) >= self._most
        wanted = bool(pushes.sum() >= WHEEL_COUNT // 3)
        if commanded is not None:
            wanted = abs(commanded) > self._slowest
        stalls = wanted and max(speed, travel) < self._slowest + noise
        stuck = (spins or stalls) and climb < CLIMBING
        elapsed = window.time - self._last
        self._last = window.time
        self._time = self._time + min(elapsed, window.duration) if stuck else 0.0
        words = "wheels turn and the rover stays" if spins else "wheels push and do not turn"
        self.reason = words if self._time >= PATIENCE else ""
        return bool(self.reason)
