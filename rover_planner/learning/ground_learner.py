# SPDX-License-Identifier: Apache-2.0
"""Learns the ground of a drive, measurement by measurement: friction, slip, resistance, sticking.

It takes rows of measurements (`drive_log`) at any rate and thinks once a tenth of a second, more
often for a fast rover. The motion must be measured without the wheels: by visual odometry, or by a
simulator.
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import SIDES, WHEEL_COUNT, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.learning.contact_sense import ContactSense
from rover_planner.learning.drive_log import PITCH, RATES, SUSPENSION, TIME, TORQUES, WIDTH, X, Y
from rover_planner.learning.friction_filter import FrictionEstimate, FrictionFilter
from rover_planner.learning.ground_map import GroundMap
from rover_planner.learning.soil_fit import SoilEstimate, SoilFit
from rover_planner.learning.stuck_watch import StuckWatch
from rover_planner.learning.wheel_health import RATE, WheelHealth
from rover_planner.learning.wheel_slip import (
    LONGEST_GAP,
    WINDOW,
    SlipWindow,
    SlipWindows,
    find_block_duration,
    find_median,
)

SLIP_SHARE = 0.15
"""Slip over rolling above which a wheel slips; rigid wheels creep by less."""
SLIP_SPEED = 0.08
"""Slip over the nominal speed above which a wheel slips."""
GRIP_SHARE, GRIP_EXCESS = 0.3, 0.1
"""Slip over rolling from which a wheel proves no grip, be its slip certain or not; and tractions
beyond what holds the rover, over the weight, from which loads are too wrong for that."""
CERTAIN_GRIP = 2.0
"""Standard errors of a mean torque by which it must exceed what a grip proves."""
LASTING = 3
"""Number of windows in a row in which a wheel that slips does."""
CERTAIN = 5.0
"""Standard deviations by which a slip must exceed zero."""
ALONG = 0.85
"""Share of a slip along the heading above which the torque shows the shear."""
MIN_LOAD = 0.3
"""Load from which a wheel counts, in sixths of the weight."""
MOST_STICKING = 0.3
"""Fluctuation of a torque over its mean, times 1 less the slip ratio, from which a wheel sticks
and slips by turns; its mean shear is then below the friction."""
MAX_UNSTEADY = 0.1
"""Acceleration of the treads, over gravity, from which a window does not count."""
SAME_PLACE = 1.0
"""Distance of a wheel, over its radius, within which its measurements are not independent."""
AT_A_PLACE = 2.0
"""Number of independent measurements that a wheel makes at one place, however long it is there:
half of the variance of their errors is common."""
SAME_TIME = 0.2
"""Time within which its measurements are not independent, either [s]."""
LEAST_NOISE = 0.10
"""Relative noise of one wheel's shear over its load while the torque is steady."""
HIDDEN_SHARE = 0.2
"""Error of the load of the wheels that slip, over what tractions push beyond what holds the rover:
they push at a contact that the map does not have."""
STICKING_LOSS = 0.3
"""Shear that the mean lacks while a wheel sticks and slips by turns, over the fluctuation times 1
less the slip ratio."""
MOST_DOUBT = 0.3
"""Error of a load over the load up to which the wheel counts."""
FASTEST = 0.8
"""Speed over the largest one from which a motor gives less torque than it is asked for."""
RESISTANCE_TIME = 10.0
"""Time constant of the mean resistance [s]."""
MARK_TIME = 1.0
"""Time after which a place is marked on the map again [s]; half a wheel farther on is sooner."""
JUMP = 0.05
"""Step of the position beyond what the wheels can drive that is no motion [m]."""
CHANGE_CERTAIN = 2.0
"""Standard deviations that are no change of a suspension angle."""
EARLY = 0.3
"""Share of the time since the last row by which a block may end early: stamps are not regular."""

Flags = NDArray[np.bool_]
_RATES, _TORQUES = RATES.start, TORQUES.start
_ANGLES = tuple(range(SUSPENSION.start, SUSPENSION.stop))
_STEPS = np.linspace(-0.5, 0.5, WINDOW)
_SIDE_WHEELS = tuple(np.array([wheel.endswith(side) for wheel in WHEELS]) for side in SIDES)


@dataclass(frozen=True, eq=False)
class GroundEstimate:
    """The estimate of the ground at one time."""

    time: float
    """Time of the last measurement [s]."""
    friction: FrictionEstimate
    """Friction under all wheels."""
    sides: dict[str, FrictionEstimate]
    """Friction under the wheels of each side."""
    classes: dict[int, FrictionEstimate]
    """Friction of the classes of ground on which wheels have been, where the map has classes."""
    slip_time: float | None
    """First time a wheel was seen to slip [s]."""
    immobilised_time: float | None
    """First time the rover was seen to be stuck [s]."""
    stuck: str
    """Reason why it is stuck now; empty if it is not."""
    slip_ratios: Floats
    """(6,) slip ratios of the last window; NaN before."""
    side_slip: float
    """Angle between the motion of the wheels and their headings, to the left [rad]."""
    resistance: float
    """Resistance to rolling over the load."""
    resistance_std: float
    """Standard deviation of it."""
    faults: dict[str, str]
    """Sensors that are not believed, by wheel, and why."""
    soil: SoilEstimate | None
    """The soil, on ground that yields."""


_SUMS = record_type(
    ("count", float),  # number of rows
    ("sums", float, (WIDTH,)),  # of what was measured
    ("known", float, (WIDTH,)),  # number of rows in which it was
    ("squares", float, (WHEEL_COUNT,)),  # sums of the squares of the torques
    ("turned", float, (WHEEL_COUNT,)),  # and of the angles by which the wheels have turned [rad]
)
"""Sums of the rows of a block."""


class GroundLearner:
    """The recursive estimator of one rover on one map."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        told: float | None = None,
        soil: str | None = None,
    ):
        """Start without measurements.

        Args:
            rover: The rover.
            terrain: Its map.
            told: Friction without any measurement (default: the rover's).
            soil: Name of the soil that is assumed at first, on ground that yields.

        Raises:
            SoilError: No soil of that name, or one that does not yield.
        """
        self._rover, wheel = rover, rover.wheel
        self._sense = ContactSense(rover, terrain)
        self._windows = SlipWindows(wheel.radius, wheel.width)
        self._soil = None if soil is None else SoilFit(rover, self._sense.weight, soil)
        self._least_slip = SLIP_SPEED * rover.nominal_speed
        self._told = told = rover.friction if told is None else told
        self._whole = FrictionFilter(told)
        self._sides = {side: FrictionFilter(told) for side in SIDES}
        self._classes: dict[int, FrictionFilter] = {}
        self._stuck = StuckWatch(rover.nominal_speed, wheel.max_torque)
        self._health = WheelHealth(rover)
        self._block, self._block_end = np.zeros(1, _SUMS), np.inf
        self._block_duration = find_block_duration(rover)
        self._turned = np.zeros(WHEEL_COUNT)
        self._forward = np.ones(WHEEL_COUNT)
        self._slipping = np.zeros(WHEEL_COUNT, dtype=int)
        self._rates, self._place = np.zeros(WHEEL_COUNT), (-math.inf, 0.0, 0.0)
        self._way = 0.0
        self._spot, self._here = np.full((WHEEL_COUNT, 2), np.inf), np.zeros(WHEEL_COUNT)
        self._marked, self._mark_time = np.full((WHEEL_COUNT, 2), np.inf), -math.inf
        self._time = self._rate_time = -math.inf
        self._recent: deque[tuple[Floats, Floats, Floats]] = deque(maxlen=WINDOW)
        self._resistance, self._resistance_square, self._steady = 0.0, 0.0, 0.0
        self._slip_time: float | None = None
        self._immobilised_time: float | None = None
        self.ground = GroundMap(terrain, wheel.width, told)
        """The estimates where the wheels have been."""
        self.window: SlipWindow | None = None
        """The last window; None before the first."""
        self.commanded: float | None = None
        """Commanded speed [m/s]; None if it is not known."""

    @property
    def stuck(self) -> str:
        """Reason why the rover is stuck now; empty if it is not."""
        return self._stuck.reason

    def change_map(self, terrain: Terrain) -> None:
        """Go on with another map of the same ground."""
        self._sense = ContactSense(self._rover, terrain)
        self.ground = GroundMap(terrain, self._rover.wheel.width, self._told)

    def take(self, row: Floats) -> bool:
        """Take a row of measurements; return whether the estimate is new."""
        row = self._health.clean(row)
        time, last = float(row[TIME]), self._time
        was_overtaken = -LONGEST_GAP < time - last < 0.0
        if not math.isfinite(time) or was_overtaken:
            return False
        self._health.take(row)
        row = self._health.drop_frozen(row)
        elapsed, self._time, new = time - last, time, False
        unrolled = abs(time - self._rate_time)
        if np.isfinite(row[RATES]).any():
            self._rate_time = time
        if not 0.0 <= elapsed <= LONGEST_GAP or unrolled > LONGEST_GAP or self._jumps(row):
            elapsed, self._block_end = 0.0, np.inf
            self._windows.begin()
            self._recent.clear()
            self._slipping[:] = 0
        is_full = time >= self._block_end - EARLY * elapsed
        if is_full and (self._block["known"][0, : SUSPENSION.stop] > 0.0).all():
            new = self._think(self._block[0])
            self._block_end = np.inf
        if self._block_end == np.inf:
            self._block, self._block_end = np.zeros(1, _SUMS), time + self._block_duration
        _add(row, elapsed, self._rates, self._turned, self._block)
        return new

    def _jumps(self, row: Floats) -> bool:
        """Return whether the position, where it was measured, is beyond what the wheels drive."""
        x, y = float(row[X]), float(row[Y])
        if not math.isfinite(x + y):
            return False
        wheel, (before, last_x, last_y) = self._rover.wheel, self._place
        self._place = self._time, x, y
        most = 2.0 * wheel.max_speed * wheel.radius * (self._time - before)
        return not math.hypot(x - last_x, y - last_y) <= most + JUMP

    def _think(self, block: Any) -> bool:
        """Take a block of measurements, _SUMS; return whether it ends a window."""
        known, count = block["known"], block["count"]
        row = np.where(known > 0.0, block["sums"], np.nan) / np.maximum(known, 1.0)
        rates = np.where(known[RATES] > 0.0, row[RATES], 0.0)
        still = 1e-3 * self._rover.wheel.max_speed
        self._forward = np.where(np.abs(rates) > still, np.sign(rates), self._forward)
        row[RATES][self._health.doubtful] = np.nan
        measured = known[TORQUES] > 0.5 * count
        if measured.any() and not measured.all():
            row[TORQUES] = np.where(measured, row[TORQUES], np.nanmean(row[TORQUES]))
        state = self._sense.feel(row, self._forward)
        if state is None:
            return False
        rows = np.maximum(known[TORQUES], 1.0)
        self._recent.append((row, block["squares"] / rows, rows))
        window = self._windows.take(float(row[TIME]), block["turned"] / count, state)
        if window is None:
            return False
        last, self.window = self.window, window
        elapsed = self._block_duration
        if last is not None and window.time > last.time:  # else the clock was set back
            elapsed = window.time - last.time
        classes = self.ground.classes_at(window.places)
        for number in set(classes[np.isfinite(classes)].astype(int).tolist()):
            self._classes.setdefault(number, FrictionFilter(self._told))
        on_class = {number: classes == number for number in self._classes}
        self._learn(window, measured, on_class, min(elapsed, window.duration))
        moved = float(np.abs(window.places - self._marked).max())
        if moved > 0.5 * self._rover.wheel.width or abs(window.time - self._mark_time) > MARK_TIME:
            self._marked, self._mark_time = window.places, window.time
            for one, wheels in zip(self._sides.values(), _SIDE_WHEELS, strict=True):
                self.ground.visit(window.places[wheels & np.isnan(classes)], one.estimate)
            for number, wheels in on_class.items():
                self.ground.visit(window.places[wheels], self._classes[number].estimate)
        return True

    @property
    def layers(self) -> Floats:
        """(2, ny, nx) mean and standard deviation of the friction on the map, NaN if not known.

        They are what was felt where wheels have been, and those of its class elsewhere.
        """
        return self.ground.spread(self._class_estimates)

    @property
    def _class_estimates(self) -> dict[int, FrictionEstimate]:
        return {number: one.estimate for number, one in sorted(self._classes.items())}

    def _learn(
        self,
        window: SlipWindow,
        measured: Flags,
        on_class: Mapping[int, Flags],
        elapsed: float,
    ) -> None:
        health, faults = self._health, self._health.faults
        rows = np.array([row for row, _, _ in self._recent])
        known = np.isfinite(rows[:, RATES]).all(axis=0)
        turning = known & ~health.rolls_backward(window)
        turning &= np.array([RATE not in faults.get(name, "") for name in WHEELS])
        good = measured & turning & np.array([name not in faults for name in WHEELS])
        slipping = self._find_slips(window)
        health.take_window(window, elapsed, not slipping.any())
        self._slipping = np.where(slipping & turning, self._slipping + 1, 0)
        lasting = self._slipping >= LASTING
        if lasting.any() and self._slip_time is None:
            self._slip_time = window.time
        torques = rows[:, TORQUES].mean(axis=0)
        climb = _find_change(rows[:, [PITCH, *_ANGLES]])
        seen = replace(window, rolling=np.where(known, window.rolling, 0.0))
        stuck = self._stuck.update(seen, torques, climb, self.commanded)
        if stuck and self._immobilised_time is None:
            self._immobilised_time = window.time
        steady = abs(window.unsteadiness) < MAX_UNSTEADY * self._rover.gravity * window.duration
        if not steady or not measured.any():
            return
        wheel = self._rover.wheel
        freely = np.abs(window.rolling) < FASTEST * wheel.max_speed * wheel.radius
        if self._soil is not None:
            self._soil.take(window, good & freely, elapsed)
        if not slipping.any() and abs(float(window.rolling.mean())) > 3.0 * window.deviation:
            self._take_resistance(window, elapsed)
        grounds = [
            (self._whole, np.ones(WHEEL_COUNT, bool)),
            *zip(self._sides.values(), _SIDE_WHEELS, strict=True),
            *((self._classes[number], wheels) for number, wheels in on_class.items()),
        ]
        slips, grips = lasting & good & freely, ~slipping & good
        self._learn_friction(window, slips, grips, torques, grounds, elapsed)

    def _find_slips(self, window: SlipWindow) -> Flags:
        """Return (6,) whether wheels slip."""
        least = np.maximum(
            np.maximum(SLIP_SHARE * np.abs(window.rolling), CERTAIN * window.deviation),
            self._least_slip,
        )
        return np.asarray(window.slip_speed > least + window.scrub + window.uneven)

    def _learn_friction(
        self,
        window: SlipWindow,
        slips: Flags,
        grips: Flags,
        torques: Floats,
        grounds: Sequence[tuple[FrictionFilter, Flags]],
        elapsed: float,
    ) -> None:
        """Take what the wheels of a window tell about the friction of the grounds below them."""
        fluctuation, error = self._find_torque_noise(torques)
        unit = self._sense.weight / WHEEL_COUNT
        loads, tractions = window.loads, window.tractions
        tractions = tractions - self._resistance * loads * np.sign(window.rolling)
        counts = (window.clear > 0.0) & (loads > MIN_LOAD * unit)
        # No ground pulls: where a load says so, the balance is wrong for all wheels.
        counts &= bool((loads + window.doubts).min() > -MIN_LOAD * unit)
        along = np.abs(window.slip) / np.maximum(window.slip_speed, 1e-9)
        sticking = fluctuation * (1.0 - np.abs(window.ratio))
        is_clear = (sticking < MOST_STICKING) & (window.doubts < MOST_DOUBT * loads)
        tells = slips & counts & is_clear & (along > ALONG) & (window.slip * tractions > 0.0)
        distance = self._go_on(window, elapsed)
        weights = self._weigh(window, tells, elapsed)
        beyond = abs(window.excess - float((window.tractions - tractions).sum()))
        most = np.maximum(GRIP_SHARE * np.abs(window.rolling), self._least_slip)
        is_right = beyond < GRIP_EXCESS * self._sense.weight
        proves = grips & counts & (np.abs(window.slip) < most) & is_right
        proved = np.maximum(np.abs(tractions) - CERTAIN_GRIP * error, 0.0)
        shears = np.abs(tractions) / np.maximum(along, 1e-9) * (1.0 + STICKING_LOSS * sticking)
        noises = loads * np.hypot(LEAST_NOISE, error / np.maximum(np.abs(tractions), 1e-9))
        for one, own in grounds:
            if own.any():
                one.drive(distance)
            told = np.flatnonzero(tells & own)
            if len(told):
                load, doubt = float(loads[told].sum()), window.doubts[told].sum()
                noise = math.hypot(*noises[told], doubt, HIDDEN_SHARE * beyond) / load
                noise = max(noise, _find_scatter(shears[told], loads[told]))
                one.slip(float(shears[told].sum()) / load, noise, float(weights[told].mean()))
            held = np.sort((proved / np.maximum(loads, 1e-9))[proves & own])
            if len(held) >= 2:  # two wheels: the contact of one may be wrong
                one.grip(float(held[-2]))

    def _find_torque_noise(self, torques: Floats) -> tuple[Floats, Floats]:
        """Return the fluctuations (6,) over the mean torques, and the mean tractions' errors [N].

        They are standard deviations of torques, and standard errors of means.
        """
        squares = np.array([squares for _, squares, _ in self._recent]).mean(axis=0)
        count = np.array([count for _, _, count in self._recent]).sum(axis=0)
        spread = np.sqrt(np.maximum(squares - torques**2, 0.0))
        fluctuation = spread / np.maximum(np.abs(torques), 1e-9)
        return fluctuation, spread / np.sqrt(count) / self._rover.wheel.radius

    def _go_on(self, window: SlipWindow, elapsed: float) -> float:
        """Return the distance to a new place [m], 0 before it is reached.

        A rover that is stuck reaches none, however it trembles.
        """
        self._way += float(find_median(window.travel)) * elapsed
        distance = abs(self._way)
        if distance < SAME_PLACE * self._rover.wheel.radius:
            return 0.0
        self._way = 0.0
        return distance

    def _weigh(self, window: SlipWindow, tells: Flags, elapsed: float) -> Floats:
        """Return (6,) numbers of independent measurements; at one place they come to an end.

        What is wrong at a place, such as the slope of the contact, stays wrong.
        """
        away = np.hypot(*(window.places - self._spot).T) > SAME_PLACE * self._rover.wheel.radius
        self._spot = np.where(away[:, None], window.places, self._spot)
        self._here = np.where(away, 0.0, self._here)
        left = np.maximum(1.0 - self._here / AT_A_PLACE, 0.0)
        weights = min(elapsed / SAME_TIME, 1.0) * left
        self._here = self._here + np.where(tells, weights, 0.0)
        return np.asarray(weights)

    def _take_resistance(self, window: SlipWindow, elapsed: float) -> None:
        share = window.excess * float(np.sign(window.rolling.mean())) / self._sense.weight
        self._steady += elapsed
        gain = elapsed / min(self._steady, RESISTANCE_TIME)
        self._resistance += gain * (share - self._resistance)
        self._resistance_square += gain * (share**2 - self._resistance_square)

    @property
    def estimate(self) -> GroundEstimate:
        """The estimate now."""
        window = self.window
        ratios = np.full(WHEEL_COUNT, np.nan) if window is None else window.ratio
        side_slip = 0.0
        if window is not None and np.median(np.abs(window.travel)) > 3.0 * window.deviation:
            side_slip = float(np.median(np.arctan2(window.aside, np.abs(window.travel))))
        spread = np.sqrt(max(self._resistance_square - self._resistance**2, 0.0))
        return GroundEstimate(
            time=self._time,
            friction=self._whole.estimate,
            sides={side: one.estimate for side, one in self._sides.items()},
            classes=self._class_estimates,
            slip_time=self._slip_time,
            immobilised_time=self._immobilised_time,
            stuck=self._stuck.reason,
            slip_ratios=ratios,
            side_slip=side_slip,
            resistance=float(self._resistance),
            resistance_std=float(spread) if self._steady else float("inf"),
            faults=self._health.faults,
            soil=None if self._soil is None else self._soil.find_estimate(),
        )


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


def _find_scatter(shears: Floats, loads: Floats) -> float:
    """Return the relative standard deviation of the sum of the shears over that of the loads.

    Wheels on one ground tell one friction; how they disagree tells the errors of their loads.
    """
    count, shear = len(shears), shears.sum()
    rest = shears - loads * (shear / loads.sum())
    return float(np.sqrt(count / max(count - 1, 1) * (rest @ rest)) / shear)


def _find_change(values: Floats) -> float:
    """Return the largest change of columns (WINDOW, n) along a line, less its noise."""
    spread = float(_STEPS @ _STEPS)
    rest = values - values.mean(axis=0)
    slopes = _STEPS @ rest / spread
    noise = np.sqrt(((rest - _STEPS[:, None] * slopes) ** 2).sum(axis=0) / (WINDOW - 2))
    return float((np.abs(slopes) - CHANGE_CERTAIN * noise / np.sqrt(spread)).max())
