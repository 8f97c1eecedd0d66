# SPDX-License-Identifier: Apache-2.0
"""Means of rows of measurements over blocks of a tenth of a second, less for a fast rover."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.rover.model import Rover
from rover_planner.learning.drive_log import RATES, SUSPENSION, TIME, TORQUES, WIDTH, X, Y
from rover_planner.learning.wheel_slip import LONGEST_GAP, find_block_duration

JUMP = 0.05
"""Step of the position beyond what the wheels can drive that is no motion [m]."""

_RATES, _TORQUES = RATES.start, TORQUES.start
_SUMS = record_type(
    ("count", float),  # number of rows
    ("sums", float, (WIDTH,)),  # of what was measured
    ("known", float, (WIDTH,)),  # number of rows in which it was
    ("squares", float, (WHEEL_COUNT,)),  # sums of the squares of the torques
    ("turned", float, (WHEEL_COUNT,)),  # and of the angles by which the wheels have turned [rad]
)
"""Sums of the rows of a block."""


@dataclass(frozen=True, eq=False)
class RowBlock:
    """The means of the rows of a block."""

    row: Floats
    """(WIDTH,) means, NaN where nothing was measured."""
    turned: Floats
    """(6,) angles by which the wheels have turned [rad]."""
    squares: Floats
    """(6,) squares of the torques."""
    counts: Floats
    """(6,) number of rows with a torque, 1 at least."""
    measured: NDArray[np.bool_]
    """(6,) whether a torque was measured most of the time; where it was not, the mean of all
    wheels is in the row."""


class RowBlocks:
    """Forms blocks from the rows of a drive."""

    def __init__(self, rover: Rover):
        """Start for a rover."""
        self.duration = find_block_duration(rover)
        """Duration of a block [s]."""
        self._most_speed = 2.0 * rover.wheel.max_speed * rover.wheel.radius
        self._sums, self._end = np.zeros(1, _SUMS), np.inf
        self._turned, self._rates = np.zeros(WHEEL_COUNT), np.zeros(WHEEL_COUNT)
        self._place = -math.inf, 0.0, 0.0
        self.time = -math.inf
        """Time of the last row [s]."""
        self.is_anew = True
        """Whether the last row began a drive anew: there was a gap or a jump before it."""

    def take(self, row: Floats) -> RowBlock | None:
        """Take a row that has a time; return the block before it, None if that goes on."""
        last, self.time = self.time, float(row[TIME])
        elapsed, block = self.time - last, None
        self.is_anew = not 0.0 <= elapsed <= LONGEST_GAP or self._jumps(row)
        if self.is_anew:
            elapsed, self._end = 0.0, np.inf
        is_full = self.time >= self._end - 1e-9
        if is_full and (self._sums["known"][0, : SUSPENSION.stop] > 0.0).all():
            block, self._end = _average(self._sums[0]), np.inf
        if self._end == np.inf:
            self._sums, self._end = np.zeros(1, _SUMS), self.time + self.duration
        _add(row, elapsed, self._rates, self._turned, self._sums)
        return block

    def _jumps(self, row: Floats) -> bool:
        """Return whether the position, where it was measured, is beyond what the wheels drive."""
        x, y = float(row[X]), float(row[Y])
        if not math.isfinite(x + y):
            return False
        before, last_x, last_y = self._place
        self._place = self.time, x, y
        most = self._most_speed * (self.time - before) + JUMP
        return not math.hypot(x - last_x, y - last_y) <= most


def _average(block: Any) -> RowBlock:
    """Return the means of a block, _SUMS."""
    known, count = block["known"], block["count"]
    row = np.where(known > 0.0, block["sums"], np.nan) / np.maximum(known, 1.0)
    measured = known[TORQUES] > 0.5 * count
    if measured.any() and not measured.all():
        row[TORQUES] = np.where(measured, row[TORQUES], np.nanmean(row[TORQUES]))
    counts = np.maximum(known[TORQUES], 1.0)
    return RowBlock(row, block["turned"] / count, block["squares"] / counts, counts, measured)


@kernel
def _add(row, elapsed, rates, turned, blocks):
    """Turn the wheels on by their rates (6,) [rad/s] over a time [s], and add a row to a block."""
    block = blocks[0]
    block.count += 1.0
    for k in range(WIDTH):
        if np.isfinite(row[k]):
            block.sums[k] += row[k]
            block.known[k] += 1.0
    for wheel in range(WHEEL_COUNT):
        rate, torque = row[_RATES + wheel], row[_TORQUES + wheel]
        rate = rate if np.isfinite(rate) else rates[wheel]
        turned[wheel] += 0.5 * elapsed * (rates[wheel] + rate)
        rates[wheel] = rate
        block.turned[wheel] += turned[wheel]
        if np.isfinite(torque):
            block.squares[wheel] += torque * torque
