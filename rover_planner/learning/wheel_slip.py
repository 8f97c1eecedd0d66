# SPDX-License-Identifier: Apache-2.0
"""Slip of the wheels over the last half second, from motion not measured at the wheels.

Measurements are averaged over blocks of a tenth of a second, or one sample if these come less
often. Slopes of straight lines through the blocks of a window are the speeds. The scatter about
the lines tells how well they are known.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.learning.contact_sense import WheelState

BLOCK = 0.1
"""Duration of a block [s]."""
WINDOW = 6
"""Number of blocks of a window."""
MAX_TURN = 0.15
"""Change of a contact's slope over a window up to which it is clear [rad]."""
SCATTER_MEMORY = 50
"""Number of windows over which the scatter is averaged."""
FEW = 30
"""Number of windows up to which the scatter is hardly known, so that much of it proves nothing."""
LONGEST_GAP = 0.5
"""Time without measurements after which a window begins anew [s]."""


@dataclass(frozen=True, eq=False)
class SlipWindow:
    """Motion of the wheels over a window."""

    time: float
    """Time of its last block [s]."""
    duration: float
    """From the first block to the last [s]."""
    rolling: Floats
    """(6,) speeds at which the treads roll, radius times rate [m/s]."""
    travel: Floats
    """(6,) speeds of the wheel centres along the ground, in the wheels' headings [m/s]."""
    aside: Floats
    """(6,) speeds of the wheel centres along their axles, to the left [m/s]."""
    deviation: float
    """Standard deviation of the slips along the headings, of the wheel known worst [m/s]."""
    scrub: Floats
    """(6,) speeds up to which treads may roll because the wheels are steered [m/s]: a wheel turns
    about the middle of its contact, which is somewhere along its width."""
    uneven: Floats
    """(6,) errors of the travel because the slopes of contacts change [m/s]."""
    places: Floats
    """(6, 2) mean positions of the wheels [m]."""
    loads: Floats
    """(6,) mean normal forces [N]."""
    doubts: Floats
    """(6,) errors of them by unclear contacts [N]."""
    tractions: Floats
    """(6,) mean tractions [N]."""
    clear: Floats
    """(6,) whether a wheel had one clear contact all the time."""
    excess: float
    """Mean of the tractions' sum beyond what holds the rover [N]."""
    unsteadiness: float
    """Change of the treads' mean speed over the window [m/s]."""

    @property
    def slip(self) -> Floats:
        """(6,) speeds of the treads over the ground along the headings, positive if spinning."""
        return self.rolling - self.travel

    @property
    def slip_speed(self) -> Floats:
        """(6,) magnitudes of the speeds of the treads over the ground [m/s]."""
        return np.hypot(self.slip, self.aside)

    @property
    def ratio(self) -> Floats:
        """(6,) slip ratios 1 - v / (r omega), within -1 and 1, 0 where a wheel stands."""
        larger = np.maximum(np.abs(self.rolling), np.abs(self.travel))
        known = larger > np.maximum(3.0 * self.deviation, 1e-6)
        ratio = np.where(known, self.slip * np.sign(self.rolling), 0.0)
        return np.clip(ratio / np.where(known, larger, 1.0), -1.0, 1.0)


class SlipWindows:
    """Forms windows from the blocks of a drive."""

    def __init__(self, radius: float, width: float):
        """Start for wheels of a radius and a width [m]."""
        self._radius, self._half_width = radius, 0.5 * width
        self._scatter: Floats | None = None
        self._seen = 0
        self._blocks: deque[tuple[float, Floats, WheelState]] = deque(maxlen=WINDOW)

    def begin(self) -> None:
        """Begin anew, after a gap."""
        self._blocks.clear()

    def take(self, time: float, turned: Floats, state: WheelState) -> SlipWindow | None:
        """Take a block; return the window that it ends, None if there is none yet.

        Args:
            time: Mean time of the block [s].
            turned: (6,) angles by which the wheels turned relative to their links [rad].
            state: State of the wheels.
        """
        self._blocks.append((time, turned, state))
        if len(self._blocks) < WINDOW:
            return None
        times = np.array([block[0] for block in self._blocks])
        states = [block[2] for block in self._blocks]
        rolled = self._radius * np.array([block[1] + block[2].links for block in self._blocks])
        centres = np.array([state.centres[:, :2] for state in states])
        steering = np.array([state.steering for state in states])
        values = np.concatenate([rolled, centres.reshape(WINDOW, -1)], axis=1)
        centred = times - times.mean()
        spread = float(centred @ centred)
        means = values.mean(axis=0)
        slopes = centred @ (values - means) / spread
        rest = values - means - centred[:, None] * slopes
        along = np.mean([state.along for state in states], axis=0)
        # A curved course also leaves a rest; it is the same in all wheels and small.
        ahead = (rest[:, WHEEL_COUNT:].reshape(WINDOW, WHEEL_COUNT, 2) * along[:, :2]).sum(axis=2)
        squares = ((rest[:, :WHEEL_COUNT] - ahead) ** 2).sum(axis=0) / (WINDOW - 2)
        if self._scatter is None:
            self._scatter = squares
        self._scatter = self._scatter + (squares - self._scatter) / SCATTER_MEMORY
        self._seen += 1
        # Errors of the heading move outer wheels most when the rover turns on the spot.
        known = max(squares.mean(), self._scatter.max())
        scatter = float(np.sqrt((1.0 + FEW / self._seen) * known))
        axles = np.mean([state.axles for state in states], axis=0)
        speeds = slopes[WHEEL_COUNT:].reshape(WHEEL_COUNT, 2)
        across = along[:, 0] * axles[:, 1] - along[:, 1] * axles[:, 0]
        angles = np.arcsin([state.along[:, 2] for state in states])
        steady = np.ptp(angles, axis=0) < MAX_TURN
        travel = (speeds[:, 0] * axles[:, 1] - speeds[:, 1] * axles[:, 0]) / across
        halves = rolled.mean(axis=1)
        steps = np.diff(halves) / np.diff(times)
        return SlipWindow(
            time=float(times[-1]),
            duration=float(times[-1] - times[0]),
            rolling=slopes[:WHEEL_COUNT],
            travel=travel,
            aside=(along[:, 0] * speeds[:, 1] - along[:, 1] * speeds[:, 0]) / across,
            deviation=scatter / np.sqrt(spread),
            scrub=self._half_width * np.ptp(steering, axis=0) / (times[-1] - times[0]),
            uneven=np.abs(travel) * np.ptp(1.0 / np.cos(angles), axis=0),
            places=means[WHEEL_COUNT:].reshape(WHEEL_COUNT, 2),
            loads=np.mean([state.loads for state in states], axis=0),
            doubts=np.mean([state.doubts for state in states], axis=0),
            tractions=np.mean([state.tractions for state in states], axis=0),
            clear=np.min([state.clear for state in states], axis=0) * steady,
            excess=float(np.mean([state.excess for state in states])),
            unsteadiness=float(steps[-1] - steps[0]),
        )
