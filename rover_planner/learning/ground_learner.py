# SPDX-License-Identifier: Apache-2.0
"""Learns the ground of a drive, measurement by measurement: friction, slip, resistance, sticking.

It takes rows of measurements (`drive_log`) at any rate and thinks once a tenth of a second, more
often for a fast rover. The motion must be measured without the wheels: by visual odometry, or by a
simulator.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rover_physics.names import SIDES, WHEEL_COUNT, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.learning.contact_sense import ContactSense
from rover_planner.learning.drive_log import PITCH, RATES, SUSPENSION, TIME
from rover_planner.learning.friction_evidence import (
    Flags,
    PlaceWeights,
    WindowTorques,
    find_evidence,
    find_slips,
)
from rover_planner.learning.friction_filter import FrictionEstimate, FrictionFilter
from rover_planner.learning.ground_map import GroundMap
from rover_planner.learning.row_blocks import RowBlock, RowBlocks
from rover_planner.learning.soil_fit import SoilEstimate, SoilFit
from rover_planner.learning.stuck_watch import StuckWatch
from rover_planner.learning.wheel_health import RATE, WheelHealth
from rover_planner.learning.wheel_slip import (
    WINDOW,
    SlipWindow,
    SlipWindows,
    find_median,
)

LASTING = 3
"""Number of windows in a row in which a wheel that slips does."""
MAX_UNSTEADY = 0.1
"""Acceleration of the treads, over gravity, from which a window does not count."""
FASTEST = 0.8
"""Speed over the largest one from which a motor gives less torque than it is asked for."""
RESISTANCE_TIME = 10.0
"""Time constant of the mean resistance [s]."""
MARK_TIME = 1.0
"""Time after which a place is marked on the map again [s]; half a wheel farther on is sooner."""
CHANGE_CERTAIN = 2.0
"""Standard deviations that are no change of a suspension angle."""

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


class RollingResistance:
    """The resistance to rolling over the load: a mean of what was seen."""

    def __init__(self) -> None:
        """Start without any; the resistance is 0."""
        self.mean = 0.0
        self._square = self._time = 0.0

    def take(self, share: float, elapsed: float) -> None:
        """Take a resistance over the load that lasted for a time [s]."""
        self._time += elapsed
        gain = elapsed / min(self._time, RESISTANCE_TIME)
        self.mean += gain * (share - self.mean)
        self._square += gain * (share**2 - self._square)

    @property
    def deviation(self) -> float:
        """Standard deviation; infinite before any was seen."""
        spread = math.sqrt(max(self._square - self.mean**2, 0.0))
        return spread if self._time else math.inf


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
        self._blocks = RowBlocks(rover)
        self._recent: deque[RowBlock] = deque(maxlen=WINDOW)
        self._windows = SlipWindows(wheel.radius, wheel.width)
        self._health = WheelHealth(self._sense.weight, wheel.max_torque)
        self._forward = np.ones(WHEEL_COUNT)
        self._slipping = np.zeros(WHEEL_COUNT, dtype=int)
        self._slip_time: float | None = None
        self._stuck = StuckWatch(rover.nominal_speed, wheel.max_torque)
        self._immobilised_time: float | None = None
        self._soil = None if soil is None else SoilFit(rover, self._sense.weight, soil)
        self._resistance = RollingResistance()
        self._weights = PlaceWeights(wheel.radius)
        self._told = told = rover.friction if told is None else told
        self._whole = FrictionFilter(told)
        self._sides = {side: FrictionFilter(told) for side in SIDES}
        self._classes: dict[int, FrictionFilter] = {}
        self._marked, self._mark_time = np.full((WHEEL_COUNT, 2), np.inf), -math.inf
        self.ground = GroundMap(terrain, wheel.width)
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
        self.ground = GroundMap(terrain, self._rover.wheel.width)

    def take(self, row: Floats) -> bool:
        """Take a row of measurements; return whether the estimate is new."""
        row = self._health.clean(row)
        if not math.isfinite(row[TIME]):
            return False
        block = self._blocks.take(row)
        if self._blocks.is_anew:
            self._windows.begin()
            self._recent.clear()
            self._slipping[:] = 0
        else:
            self._health.take(row)
        return block is not None and self._think(block)

    def _think(self, block: RowBlock) -> bool:
        """Take a block of measurements; return whether it ends a window."""
        row = block.row
        rates = np.where(np.isnan(row[RATES]), 0.0, row[RATES])
        still = 1e-3 * self._rover.wheel.max_speed
        self._forward = np.where(np.abs(rates) > still, np.sign(rates), self._forward)
        state = self._sense.feel(row, self._forward)
        if state is None:
            return False
        self._recent.append(block)
        window = self._windows.take(float(row[TIME]), block.turned, state)
        if window is None:
            return False
        last, self.window = self.window, window
        elapsed = self._blocks.duration
        if last is not None and window.time > last.time:  # else the clock was set back
            elapsed = window.time - last.time
        classes = self.ground.classes_at(window.places)
        for number in set(classes[np.isfinite(classes)].astype(int).tolist()):
            self._classes.setdefault(number, FrictionFilter(self._told))
        on_class = {number: classes == number for number in self._classes}
        self._learn(window, block.measured, on_class, min(elapsed, window.duration))
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
        """Take a window that lasts for a time [s] more than the one before.

        `measured` are the wheels whose torques were; `on_class` are those on a class of ground.
        """
        health, faults = self._health, self._health.faults
        turning = ~health.doubtful & ~health.rolls_backward(window)
        turning &= np.array([RATE not in faults.get(name, "") for name in WHEELS])
        good = measured & turning & np.array([name not in faults for name in WHEELS])
        slipping = find_slips(self._rover, window)
        health.take_window(window, elapsed, not slipping.any())
        self._slipping = np.where(slipping, self._slipping + 1, 0)
        lasting = (self._slipping >= LASTING) & turning
        if lasting.any() and self._slip_time is None:
            self._slip_time = window.time
        torques = WindowTorques.of(self._recent)
        climb = _find_change(np.array([one.row for one in self._recent])[:, [PITCH, *_ANGLES]])
        stuck = self._stuck.update(window, torques.mean, climb, self.commanded)
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
            ahead = float(np.sign(window.rolling.mean()))
            self._resistance.take(window.excess * ahead / self._sense.weight, elapsed)
        found = find_evidence(
            self._rover,
            window,
            torques,
            self._resistance.mean,
            slips=lasting & good & freely,
            grips=~slipping & good,
        )
        weights = self._weights.weigh(window.places, found.tells, elapsed)
        distance = abs(float(find_median(window.travel))) * elapsed
        grounds = [
            (self._whole, np.ones(WHEEL_COUNT, bool)),
            *zip(self._sides.values(), _SIDE_WHEELS, strict=True),
            *((self._classes[number], wheels) for number, wheels in on_class.items()),
        ]
        for friction, own in grounds:
            if own.any():
                friction.drive(distance)
            found.teach(friction, own, weights)

    @property
    def estimate(self) -> GroundEstimate:
        """The estimate now."""
        window = self.window
        ratios = np.full(WHEEL_COUNT, np.nan) if window is None else window.ratio
        side_slip = 0.0
        if window is not None and np.median(np.abs(window.travel)) > 3.0 * window.deviation:
            side_slip = float(np.median(np.arctan2(window.aside, np.abs(window.travel))))
        return GroundEstimate(
            time=self._blocks.time,
            friction=self._whole.estimate,
            sides={side: one.estimate for side, one in self._sides.items()},
            classes=self._class_estimates,
            slip_time=self._slip_time,
            immobilised_time=self._immobilised_time,
            stuck=self._stuck.reason,
            slip_ratios=ratios,
            side_slip=side_slip,
            resistance=self._resistance.mean,
            resistance_std=self._resistance.deviation,
            faults=self._health.faults,
            soil=None if self._soil is None else self._soil.find_estimate(),
        )


def _find_change(values: Floats) -> float:
    """Return the largest change of columns (WINDOW, n) along a line, less its noise."""
    spread = float(_STEPS @ _STEPS)
    rest = values - values.mean(axis=0)
    slopes = _STEPS @ rest / spread
    noise = np.sqrt(((rest - _STEPS[:, None] * slopes) ** 2).sum(axis=0) / (WINDOW - 2))
    return float((np.abs(slopes) - CHANGE_CERTAIN * noise / np.sqrt(spread)).max())
