# SPDX-License-Identifier: Apache-2.0
"""Slip of the wheels over the last half second, from motion not measured at the wheels.

Measurements are averaged over blocks of a tenth of a second, less for a fast rover, or one sample
if these come less often. Slopes of straight lines through the blocks of a window are the speeds.
The scatter about the lines tells how well they are known.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.rover.model import Rover
from rover_planner.learning.contact_sense import WHEEL_STATE

BLOCK = 0.1
"""Longest duration of a block [s]."""
BLOCK_LENGTH = 0.08
"""Longest distance of a block at the rover's nominal speed [wheel radii]: the ground below a wheel
must hardly change in a window."""
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

    @cached_property
    def slip(self) -> Floats:
        """(6,) speeds of the treads over the ground along the headings, positive if spinning."""
        return self.rolling - self.travel

    @cached_property
    def slip_speed(self) -> Floats:
        """(6,) magnitudes of the speeds of the treads over the ground [m/s]."""
        return np.hypot(self.slip, self.aside)

    @cached_property
    def ratio(self) -> Floats:
        """(6,) slip ratios 1 - v / (r omega), within -1 and 1, 0 where a wheel stands."""
        larger = np.maximum(np.abs(self.rolling), np.abs(self.travel))
        known = larger > np.maximum(3.0 * self.deviation, 1e-6)
        ratio = np.where(known, self.slip * np.sign(self.rolling), 0.0)
        return np.clip(ratio / np.where(known, larger, 1.0), -1.0, 1.0)


_BLOCK = record_type(("time", float), ("turned", float, (WHEEL_COUNT,)), ("state", WHEEL_STATE))
"""A block: its mean time [s], and the angles by which the wheels have turned [rad]."""

_FIT = record_type(
    ("spread", float),  # sum of the squares of the times about their mean [s^2]
    ("squares", float, (WHEEL_COUNT,)),  # squared scatter of the slips along the headings [m^2]
    *((name, float, (WHEEL_COUNT,)) for name in (
        "rolling", "travel", "aside", "scrub", "uneven", "loads", "doubts", "tractions", "clear",
    )),
    ("places", float, (WHEEL_COUNT, 2)),
    ("excess", float),
    ("unsteadiness", float),
)  # fmt: skip
"""A window but for its deviation, which others before it tell, too."""


class SlipWindows:
    """Forms windows from the blocks of a drive."""

    def __init__(self, radius: float, width: float):
        """Start for wheels of a radius and a width [m]."""
        self._radius, self._half_width = radius, 0.5 * width
        self._scatter: Floats | None = None
        self._seen = 0
        self._blocks, self._count = np.zeros(WINDOW, _BLOCK), 0
        self._fits = np.zeros(1, _FIT)

    def begin(self) -> None:
        """Begin anew, after a gap."""
        self._count = 0

    def take(self, time: float, turned: Floats, state: Any) -> SlipWindow | None:
        """Take a block; return the window that it ends, None if there is none yet.

        Args:
            time: Mean time of the block [s].
            turned: (6,) angles by which the wheels turned relative to their links [rad].
            state: WHEEL_STATE of it.
        """
        blocks = self._blocks
        blocks[:-1] = blocks[1:]
        blocks[-1] = time, turned, state
        self._count += 1
        if self._count < WINDOW:
            return None
        _fit_window(blocks, self._radius, self._half_width, self._fits)
        fits = self._fits.copy()
        fit = {name: fits[name][0] for name in fits.dtype.fields or ()}
        squares, spread = fit.pop("squares"), fit.pop("spread")
        if self._scatter is None:
            self._scatter = squares.copy()
        self._scatter += (squares - self._scatter) / SCATTER_MEMORY
        self._seen += 1
        # Errors of the heading move outer wheels most when the rover turns on the spot.
        known = max(squares.mean(), self._scatter.max())
        scatter = float(np.sqrt((1.0 + FEW / self._seen) * known))
        return SlipWindow(
            time=time,
            duration=float(time - blocks["time"][0]),
            deviation=scatter / np.sqrt(spread),
            **fit,
        )


@kernel
def _fit_window(blocks, radius, half_width, fits):
    """Fit straight lines to distances of treads and wheel centres over the blocks of a window."""
    fit = fits[0]
    middle = 0.0
    for k in range(WINDOW):
        middle += blocks[k].time / WINDOW
    fit.spread = fit.excess = 0.0
    for k in range(WINDOW):
        fit.spread += (blocks[k].time - middle) ** 2
        fit.excess += blocks[k].state.excess / WINDOW
    first = _roll(blocks[1], radius) - _roll(blocks[0], radius)
    last = _roll(blocks[WINDOW - 1], radius) - _roll(blocks[WINDOW - 2], radius)
    fit.unsteadiness = last / (blocks[WINDOW - 1].time - blocks[WINDOW - 2].time)
    fit.unsteadiness -= first / (blocks[1].time - blocks[0].time)
    for wheel in range(WHEEL_COUNT):
        _fit_motion(wheel, blocks, middle, radius, fit)
        _average(wheel, blocks, half_width, fit)


@kernel
def _roll(block, radius):
    """Return the mean distance of all treads to a block [m]."""
    total = 0.0
    for wheel in range(WHEEL_COUNT):
        total += radius * (block.turned[wheel] + block.state.links[wheel])
    return total / WHEEL_COUNT


@kernel
def _fit_motion(wheel, blocks, middle, radius, fit):
    """Write place and speeds of a wheel and the scatter of its slip along its heading."""
    rolled = x = y = along_x = along_y = axle_x = axle_y = 0.0
    for k in range(WINDOW):
        state = blocks[k].state
        rolled += radius * (blocks[k].turned[wheel] + state.links[wheel]) / WINDOW
        x += state.centres[wheel, 0] / WINDOW
        y += state.centres[wheel, 1] / WINDOW
        along_x += state.along[wheel, 0] / WINDOW
        along_y += state.along[wheel, 1] / WINDOW
        axle_x += state.axles[wheel, 0] / WINDOW
        axle_y += state.axles[wheel, 1] / WINDOW
    rolling = speed_x = speed_y = 0.0
    for k in range(WINDOW):
        state, weight = blocks[k].state, (blocks[k].time - middle) / fit.spread
        distance = radius * (blocks[k].turned[wheel] + state.links[wheel])
        rolling += weight * (distance - rolled)
        speed_x += weight * (state.centres[wheel, 0] - x)
        speed_y += weight * (state.centres[wheel, 1] - y)
    squares = 0.0
    for k in range(WINDOW):
        state, since = blocks[k].state, blocks[k].time - middle
        distance = radius * (blocks[k].turned[wheel] + state.links[wheel])
        rest_x = state.centres[wheel, 0] - x - since * speed_x
        rest_y = state.centres[wheel, 1] - y - since * speed_y
        # A curved course also leaves a rest; it is the same in all wheels and small.
        rest = distance - rolled - since * rolling - rest_x * along_x - rest_y * along_y
        squares += rest * rest / (WINDOW - 2)
    across = along_x * axle_y - along_y * axle_x
    fit.squares[wheel], fit.rolling[wheel] = squares, rolling
    fit.places[wheel, 0], fit.places[wheel, 1] = x, y
    fit.travel[wheel] = (speed_x * axle_y - speed_y * axle_x) / across
    fit.aside[wheel] = (along_x * speed_y - along_y * speed_x) / across


@kernel
def _average(wheel, blocks, half_width, fit):
    """Write what a wheel felt, and how steady its contact and its steering were."""
    fit.loads[wheel] = fit.doubts[wheel] = fit.tractions[wheel] = 0.0
    clear, least, most = 1.0, np.inf, -np.inf
    right, left, level, steep = np.inf, -np.inf, np.inf, -np.inf
    for k in range(WINDOW):
        state = blocks[k].state
        fit.loads[wheel] += state.loads[wheel] / WINDOW
        fit.doubts[wheel] += state.doubts[wheel] / WINDOW
        fit.tractions[wheel] += state.tractions[wheel] / WINDOW
        clear = min(clear, state.clear[wheel])
        angle = np.arcsin(state.along[wheel, 2])
        least, most = min(least, angle), max(most, angle)
        level, steep = min(level, 1.0 / np.cos(angle)), max(steep, 1.0 / np.cos(angle))
        right, left = min(right, state.steering[wheel]), max(left, state.steering[wheel])
    fit.clear[wheel] = clear if most - least < MAX_TURN else 0.0
    fit.scrub[wheel] = half_width * (left - right) / (blocks[WINDOW - 1].time - blocks[0].time)
    fit.uneven[wheel] = abs(fit.travel[wheel]) * (steep - level)


def find_block_duration(rover: Rover) -> float:
    """Return the duration of a block [s]."""
    return min(BLOCK, BLOCK_LENGTH * rover.wheel.radius / rover.nominal_speed)


def find_median(values: Floats) -> Floats:
    """Return the medians of six values (..., 6); several times faster than NumPy's."""
    return np.sort(values)[..., 2:4].mean(axis=-1)
