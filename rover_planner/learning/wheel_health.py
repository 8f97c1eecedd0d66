# SPDX-License-Identifier: Apache-2.0
"""Tells wheels whose torque or rate cannot be believed: missing, frozen, or of the wrong sign."""

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEEL_COUNT, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.rover.model import Rover
from rover_planner.learning.drive_log import (
    HALF_TURN,
    RATES,
    ROLL,
    SUSPENSION,
    TIME,
    TORQUES,
    WIDTH,
)
from rover_planner.learning.stuck_watch import SLOWEST
from rover_planner.learning.wheel_slip import LONGEST_GAP, SlipWindow

RATE = "rate"
"""Word in each fault of a wheel's rate, and in no other."""
FROZEN_TIME = 1.0
"""Time without any change, while values of other wheels change, of a frozen value [s]."""
DOUBTFUL_TIME = 0.25
"""Time after which it may be frozen [s]."""
OTHERS = 3
"""Number of other wheels whose values must change meanwhile."""
CHANGE = 1.5
"""Change over the smallest one ever seen from which a value changes: the last digit of a coarse
sensor may turn at some wheels and stay at others."""
SPIKE, RUNAWAY = 1.3, 2.0
"""Torque and rate over the largest ones of a motor from which they are errors."""
SIGN_TIME = 4.0
"""Time constant of the search for wrong signs [s]."""
SIGN_SHARE = 0.25
"""Share of a contradiction that is left when one sign is turned, if this sign is wrong."""
LEAST_STRAIGHT = 0.75
"""Slowest wheel over the fastest one from which a rover goes straight enough to look at signs: in
tighter curves and on the spot, lateral forces whose shares are assumed hold it, too."""
LEAST_EXCESS = 0.03
"""Contradiction of the tractions from which signs are looked at, over the weight."""
TURNING_BACK = 0.3
"""Correlation of a wheel's rolling with minus its travel if its rate has the wrong sign."""
_TORQUES, _RATES = TORQUES.start, RATES.start
_ANGLES = slice(ROLL, SUSPENSION.stop)
_WATCH = record_type(
    ("last", float, (2, WHEEL_COUNT)),  # last torques [N m] and rates [rad/s]
    ("still", float, (2, WHEEL_COUNT)),  # time for which each has stood still or was missing [s]
    ("steps", float, (2,)),  # smallest changes of torques [N m] and rates [rad/s]
)


class WheelHealth:
    """Watches torques and rates of the wheels."""

    def __init__(self, rover: Rover):
        """Start with good sensors."""
        self._weight, self._most = rover.weight, rover.wheel.max_torque
        self._limits = np.full(WIDTH, np.inf)
        self._limits[TORQUES] = SPIKE * rover.wheel.max_torque
        self._limits[RATES] = RUNAWAY * rover.wheel.max_speed
        self._limits[_ANGLES] = HALF_TURN
        self._slowest = SLOWEST * rover.nominal_speed / rover.wheel.radius
        self._watches = np.zeros(1, _WATCH)
        self._watches["steps"] = np.inf
        self._still = self._watches["still"][0]
        self._time = np.nan
        self._excess = 0.0
        self._turned = np.zeros(WHEEL_COUNT)
        self._backward = np.zeros(WHEEL_COUNT)

    def clean(self, row: Floats) -> Floats:
        """Return a row without torques and rates that no motor, and angles that no rover has."""
        wrong = np.abs(row) > self._limits
        return np.where(wrong, np.nan, row) if wrong.any() else row

    def take(self, row: Floats) -> None:
        """Take a row of measurements."""
        elapsed = row[TIME] - self._time
        elapsed = elapsed if 0.0 < elapsed <= LONGEST_GAP else 0.0
        _take(row, elapsed, 0.99 * self._most, self._slowest, self._watches)
        self._time = row[TIME]

    def drop_frozen(self, row: Floats) -> Floats:
        """Return the row that was taken last without torques and rates that are frozen."""
        frozen = self._still > FROZEN_TIME
        if frozen.any():
            row = row.copy()
            row[TORQUES][frozen[0]], row[RATES][frozen[1]] = np.nan, np.nan
        return row

    def take_window(self, window: SlipWindow, elapsed: float, grips: bool) -> None:
        """Take a window to look at signs.

        Args:
            window: The window.
            elapsed: Time since the last one [s].
            grips: Whether all wheels grip, so that the tractions must hold the rover.
        """
        share = min(elapsed / SIGN_TIME, 1.0)
        self._backward += share * (self.rolls_backward(window) - self._backward)
        if grips and _goes_straight(window):
            self._excess += share * (abs(window.excess) - self._excess)
            turned = np.abs(window.excess - 2.0 * window.tractions)
            self._turned += share * (turned - self._turned)

    def rolls_backward(self, window: SlipWindow) -> NDArray[np.bool_]:
        """Return (6,) whether wheels roll as fast as they travel, but the other way."""
        moves = np.abs(window.travel) > 5.0 * window.deviation + 1e-3
        rest = np.abs(window.rolling + window.travel)
        return np.asarray(moves & (rest < TURNING_BACK * np.abs(window.travel)))

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """(6,) whether a rate stands still while others change; it may be frozen."""
        return np.asarray(self._still[1] > DOUBTFUL_TIME)

    @property
    def faults(self) -> dict[str, str]:
        """Faults, with the wheels that have them."""
        found: dict[str, str] = {}
        watch = self._watches[0]
        frozen, missing = self._still > FROZEN_TIME, np.isnan(watch["last"])
        signs = np.zeros(WHEEL_COUNT, dtype=bool)
        if self._excess > LEAST_EXCESS * self._weight:
            best = int(np.argmin(self._turned))
            signs[best] = self._turned[best] < SIGN_SHARE * self._excess
        gone, frozen = frozen & missing, frozen & ~missing
        for word, mask in (
            ("no torque", gone[0]),
            (f"no {RATE}", gone[1]),
            ("torque is frozen", frozen[0]),
            (f"{RATE} is frozen", frozen[1]),
            ("torque has the wrong sign", signs),
            (f"{RATE} has the wrong sign", self._backward > 0.6),
        ):
            found |= {WHEELS[k]: word for k in np.flatnonzero(mask) if WHEELS[k] not in found}
        return found


@kernel
def _take(row, elapsed, full, slowest, watches):
    """Take a row of measurements.

    Torques of at least `full` [N m] may stand still at a wheel that turns no faster than `slowest`
    [rad/s].
    """
    watch = watches[0]
    for kind in range(2):
        first = _TORQUES if kind == 0 else _RATES
        changes = 0
        for wheel in range(WHEEL_COUNT):
            change = abs(row[first + wheel] - watch.last[kind, wheel])
            if change > 0.0:
                watch.steps[kind] = min(watch.steps[kind], change)
            if change > CHANGE * watch.steps[kind]:
                changes += 1
        for wheel in range(WHEEL_COUNT):
            value, turns = row[first + wheel], abs(row[_RATES + wheel]) > slowest
            pushes = kind == 0 and abs(value) >= full and not turns
            stays = value == watch.last[kind, wheel] and not pushes
            if value != value or (stays and changes >= OTHERS):
                watch.still[kind, wheel] += elapsed
            elif not stays:
                watch.still[kind, wheel] = 0.0
            watch.last[kind, wheel] = value


def _goes_straight(window: SlipWindow) -> bool:
    """Return whether all wheels roll the same way, at almost the same speed."""
    slowest, fastest = sorted((window.rolling.min(), window.rolling.max()), key=abs)
    return bool(slowest * fastest > LEAST_STRAIGHT * fastest**2)
