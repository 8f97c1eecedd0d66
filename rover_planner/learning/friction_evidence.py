# SPDX-License-Identifier: Apache-2.0
"""What the wheels of a window tell about the friction below them: by slipping, and by gripping."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.learning.drive_log import TORQUES
from rover_planner.learning.friction_filter import FrictionFilter
from rover_planner.learning.row_blocks import RowBlock
from rover_planner.learning.wheel_slip import SlipWindow

SLIP_SHARE = 0.15
"""Slip over rolling above which a wheel slips; rigid wheels creep by less."""
SLIP_SPEED = 0.08
"""Slip over the nominal speed above which a wheel slips."""
CERTAIN = 5.0
"""Standard deviations by which a slip must exceed zero."""
GRIP_SHARE, GRIP_EXCESS = 0.3, 0.1
"""Slip over rolling from which a wheel proves no grip, be its slip certain or not; and tractions
beyond what holds the rover, over the weight, from which loads are too wrong for that."""
CERTAIN_GRIP = 2.0
"""Standard errors of a mean torque by which it must exceed what a grip proves."""
ALONG = 0.85
"""Share of a slip along the heading above which the torque shows the shear."""
MIN_LOAD, MAX_LOAD = 0.3, 4.0
"""Loads of wheels that count, in sixths of the weight."""
MOST_STICKING = 0.3
"""Fluctuation of a torque over its mean, times 1 less the slip ratio, from which a wheel sticks
and slips by turns; its mean shear is then below the friction."""
SAME_PLACE = 0.5
"""Distance of a wheel, over its radius, within which its measurements are not independent."""
AT_A_PLACE = 1.0
"""Number of independent measurements that a wheel makes at one place."""
SAME_TIME = 0.2
"""Time within which its measurements are not independent, either [s]."""
LEAST_NOISE, FLUCTUATION_NOISE = 0.10, 0.4
"""Relative noise of one wheel's shear over its load while the torque is steady, and per square of
the fluctuation of the torque over its mean: what a mean lacks as shears turn and stick is of
second order."""
HIDDEN_SHARE = 0.2
"""Error of the load of the wheels that slip, over what tractions push beyond what holds the rover:
they push at a contact that the map does not have."""
STICKING_LOSS = 0.3
"""Shear that the mean lacks while a wheel sticks and slips by turns, over the fluctuation times 1
less the slip ratio."""
MOST_DOUBT = 0.3
"""Error of a load over the load up to which the wheel counts."""

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class WindowTorques:
    """The torques of the wheels over a window."""

    mean: Floats
    """(6,) means [N m]."""
    fluctuation: Floats
    """(6,) standard deviations over the means."""
    errors: Floats
    """(6,) standard errors of the means [N m]."""

    @classmethod
    def of(cls, blocks: Iterable[RowBlock]) -> "WindowTorques":
        """Return those of the blocks of a window."""
        mean = np.array([one.row[TORQUES] for one in blocks]).mean(axis=0)
        squares = np.array([one.squares for one in blocks]).mean(axis=0)
        count = np.array([one.counts for one in blocks]).sum(axis=0)
        spread = np.sqrt(np.maximum(squares - mean**2, 0.0))
        return cls(mean, spread / np.maximum(np.abs(mean), 1e-9), spread / np.sqrt(count))


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the wheels of a window tell about the friction below them."""

    tells: Flags
    """(6,) whether a wheel slips so that its shear is the friction."""
    shears: Floats
    """(6,) shears of those that do [N]."""
    loads: Floats
    """(6,) their loads [N]."""
    noises: Floats
    """(6,) errors of shear and load that wheels do not have in common [N]."""
    doubts: Floats
    """(6,) errors by unclear contacts [N]."""
    hidden: float
    """Error of the load of all by contacts that the map does not have [N]."""
    holds: Flags
    """(6,) whether a wheel grips so that the friction is at least what it uses."""
    proved: Floats
    """(6,) friction that it proves then."""

    def teach(self, friction: FrictionFilter, own: Flags, weights: Floats) -> None:
        """Tell the friction of the ground below some wheels.

        Args:
            friction: The friction of one ground.
            own: (6,) whether a wheel is on it.
            weights: (6,) numbers of independent measurements.
        """
        told = np.flatnonzero(self.tells & own)
        if len(told):
            load, doubt = float(self.loads[told].sum()), self.doubts[told].sum()
            noise = math.hypot(*self.noises[told], doubt, self.hidden) / load
            share = float(self.shears[told].sum()) / load
            friction.slip(share, noise, float(weights[told].mean()))
        held = np.sort(self.proved[self.holds & own])
        if len(held) >= 2:  # two wheels: the contact of one may be wrong
            friction.grip(float(held[-2]))


def find_slips(rover: Rover, window: SlipWindow) -> Flags:
    """Return (6,) whether wheels slip."""
    least = np.maximum(
        np.maximum(SLIP_SHARE * np.abs(window.rolling), CERTAIN * window.deviation),
        SLIP_SPEED * rover.nominal_speed,
    )
    return np.asarray(window.slip_speed > least + window.scrub + window.uneven)


def find_evidence(
    rover: Rover,
    window: SlipWindow,
    torques: WindowTorques,
    resistance: float,
    slips: Flags,
    grips: Flags,
) -> Evidence:
    """Return what the wheels of a window tell.

    Args:
        rover: The rover.
        window: Motion and loads of its wheels.
        torques: Their torques.
        resistance: Resistance to rolling over the load, which is no shear.
        slips: (6,) wheels that slip and whose torque is their shear at the ground.
        grips: (6,) wheels that do not slip and whose torque can be believed.
    """
    loads, unit = window.loads, rover.weight / WHEEL_COUNT
    tractions = window.tractions - resistance * loads * np.sign(window.rolling)
    beyond = abs(window.excess - float((window.tractions - tractions).sum()))
    counts = (window.clear > 0.0) & (loads > MIN_LOAD * unit) & (loads < MAX_LOAD * unit)
    along = np.abs(window.slip) / np.maximum(window.slip_speed, 1e-9)
    sticking = torques.fluctuation * (1.0 - np.abs(window.ratio))
    most = np.maximum(GRIP_SHARE * np.abs(window.rolling), SLIP_SPEED * rover.nominal_speed)
    certain = np.abs(tractions) - CERTAIN_GRIP * (torques.errors / rover.wheel.radius)
    return Evidence(
        tells=(
            slips
            & counts
            & (along > ALONG)
            & (window.slip * tractions > 0.0)
            & (sticking < MOST_STICKING)
            & (window.doubts < MOST_DOUBT * loads)
        ),
        shears=np.abs(tractions) / np.maximum(along, 1e-9) * (1.0 + STICKING_LOSS * sticking),
        loads=loads,
        noises=loads * np.hypot(LEAST_NOISE, FLUCTUATION_NOISE * torques.fluctuation**2),
        doubts=window.doubts,
        hidden=HIDDEN_SHARE * beyond,
        holds=(
            grips & counts & (np.abs(window.slip) < most) & (beyond < GRIP_EXCESS * rover.weight)
        ),
        proved=np.maximum(certain, 0.0) / np.maximum(loads, 1e-9),
    )


class PlaceWeights:
    """Numbers of independent measurements of wheels, which tell less and less at one place.

    What is wrong at a place, such as the slope of the contact, stays wrong.
    """

    def __init__(self, radius: float):
        """Start for wheels of a radius [m] that have measured nothing."""
        self._same = SAME_PLACE * radius
        self._spot, self._here = np.full((WHEEL_COUNT, 2), np.inf), np.zeros(WHEEL_COUNT)

    def weigh(self, places: Floats, tells: Flags, elapsed: float) -> Floats:
        """Return the numbers (6,) of a window after a time [s] in which some wheels tell."""
        away = np.hypot(*(places - self._spot).T) > self._same
        self._spot = np.where(away[:, None], places, self._spot)
        self._here = np.where(away, 0.0, self._here)
        weights = min(elapsed / SAME_TIME, 1.0) * np.exp(-self._here / AT_A_PLACE)
        self._here = self._here + np.where(tells, weights, 0.0)
        return np.asarray(weights)
