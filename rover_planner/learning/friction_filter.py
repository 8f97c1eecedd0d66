# SPDX-License-Identifier: Apache-2.0
"""A recursive estimate of one ground's friction, on a grid of friction coefficients.

A wheel that slips measures the friction, a wheel that grips bounds it from below. The grid holds
the chance of each coefficient, so that an interval is as wide as what was felt allows, and open
above where nothing slipped.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from rover_physics.numerics.arrays import Floats

GRID = np.geomspace(0.03, 3.0, 256)
"""Coefficients that are told apart; neighbours differ by 1.8 %."""
PRIOR_SPREAD = 0.6
"""Standard deviation of the logarithm of an unknown ground's friction about what is told."""
BOUND_NOISE, DOUBT = 0.08, 0.02
"""Standard deviation of a bound, relative, and the chance that it is wrong."""
LEAST = 1e-3
"""Use of friction below which a bound tells nothing."""
COMMON = 0.04
"""Standard deviation of what all measurements have in common, relative: masses, radius."""
FREEDOM = 5.0
"""Degrees of freedom of a measurement's error: Student's t has heavy tails, for wheels between two
contacts."""
CHANGE = 0.05
"""Chance that the ground changes on a metre."""
MEMORY = 2.0
"""Way after which a bound has lost a factor e [m]."""
BOUNDED = 0.975
"""Chance of what is below the upper end of an interval; 1 minus this is below the lower end."""
ENOUGH = 1.6
"""Number of independent slips that bound the friction from above."""


@dataclass(frozen=True)
class FrictionEstimate:
    """Friction of the ground with its uncertainty."""

    mean: float
    """Mean: of the told friction given the bound while nothing has slipped; else of what was
    measured, whatever was told, as if the ground had not changed since."""
    std: float
    """Standard deviation about it; the ground may have changed."""
    low: float
    """Lower end of the 95 % interval; while nothing has slipped, what the wheels proved."""
    high: float | None
    """Upper end of it; None while nothing bounds it."""


class FrictionFilter:
    """The chances of the coefficients of one ground."""

    def __init__(self, told: float):
        """Start with what is told about the friction."""
        middle = told * np.exp(-0.5 * PRIOR_SPREAD**2)  # so that the mean is what is told
        spread = np.log(GRID / middle) / PRIOR_SPREAD
        prior = np.exp(-0.5 * spread**2)
        self._prior = prior / prior.sum()
        self._chances = self._prior.copy()
        self._bound, self._driven = 0.0, 0.0
        self._slips = np.zeros_like(GRID)
        """Number of independent slips since the ground changed, given each coefficient."""

    def drive(self, distance: float) -> None:
        """Take that the rover has driven a distance [m]: the ground may have changed."""
        self._driven += distance
        self._bound *= math.exp(-distance / MEMORY)

    def _doubt(self) -> None:
        """Let chances return to those of the beginning by the distance that was driven."""
        kept = math.exp(-CHANGE * self._driven)
        same, self._driven = kept * self._chances, 0.0
        self._chances = same + (1.0 - kept) * self._prior
        self._slips *= same / np.maximum(self._chances, 1e-300)

    def slip(self, use: float, noise: float, weight: float) -> None:
        """Take the shear over the load of wheels that slip.

        Args:
            use: Shear over load.
            noise: Standard deviation of the use, relative.
            weight: Number of independent measurements that this one is.
        """
        error = np.log(max(use, LEAST) / GRID) / noise
        self._update((1.0 + error**2 / FREEDOM) ** (-0.5 * (FREEDOM + 1.0) * weight))
        self._slips += weight

    def grip(self, use: float) -> None:
        """Take the shear over the load of a wheel that grips, which the friction exceeds."""
        if use > max(self._bound, LEAST):
            self._update(_chance_above(use) / _chance_above(self._bound))
            self._bound = use

    def _update(self, likelihood: Floats) -> None:
        self._doubt()
        chances = self._chances * likelihood
        self._chances = chances / chances.sum()

    @property
    def estimate(self) -> FrictionEstimate:
        """Mean, standard deviation and interval."""
        self._doubt()
        measured = self._slips >= ENOUGH
        is_bounded = self._chances[measured].sum() > 0.5
        chances = self._chances / self._prior if is_bounded else self._chances
        chances = chances / chances.sum()
        likely = np.where(measured, chances, 0.0) if is_bounded else chances
        mean = float(likely @ GRID / likely.sum())
        spread = np.hypot(np.sqrt(max(float(chances @ (GRID - mean) ** 2), 0.0)), COMMON * mean)
        below = _widening() @ chances
        low, high = (float(np.interp(p, below, GRID)) for p in (1.0 - BOUNDED, BOUNDED))
        proved = self._bound * (1.0 - 2.0 * BOUND_NOISE)
        if not is_bounded:
            return FrictionEstimate(mean, float(spread), min(low, proved), None)
        return FrictionEstimate(mean, float(spread), low, high)


def _chance_above(use: float) -> Floats:
    """Return the chance of feeling this use or more of a gripping wheel."""
    if use < LEAST:
        return np.ones_like(GRID)
    return np.asarray((1.0 - DOUBT) * ndtr((GRID - use) / (BOUND_NOISE * use)) + DOUBT)


@lru_cache
def _widening() -> Floats:
    """Return what makes cumulative chances of chances, widened by the common error.

    This error is a normal distribution in the logarithm of the friction.
    """
    return np.asarray(ndtr(np.log(GRID[:, None] / GRID[None, :]) / COMMON))
