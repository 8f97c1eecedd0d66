# SPDX-License-Identifier: Apache-2.0
"""A recursive estimate of one ground's friction, on a grid of friction coefficients.

A wheel that slips measures the friction, a wheel that grips bounds it from below. The grid holds
the chance of each coefficient, so that an interval is as wide as what was felt allows, and open
above where nothing slipped.

A slipping wheel often sticks for an instant, which no average over its torque shows: a use of
friction below 1 is then likely, one above 1 is an error of measurement. So the density of what a
wheel measures has an exponential tail below the friction. How long it is depends on how much the
torque fluctuates; a factor of it is estimated beside the friction.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import erfcx, log_ndtr, ndtr

from rover_physics.numerics.arrays import Floats

GRID = np.geomspace(0.03, 3.0, 256)
"""Coefficients that are told apart; neighbours differ by 1.8 %."""
TAILS = np.array([0.5, 1.0, 2.0, 4.0])
"""Factors of the tail."""
STEADY_TAIL, TAIL_PER_FLUCTUATION = 0.02, 0.2
"""Tail of a wheel of steady torque, and its growth with the torque's relative fluctuation; over
the friction."""
PRIOR_SPREAD = 0.6
"""Standard deviation of the logarithm of an unknown ground's friction about what is told."""
NOISE = 0.05
"""Standard deviation of a measured use of friction, relative: contact angles and loads."""
BOUND_NOISE, DOUBT = 0.08, 0.02
"""Standard deviation of a bound, relative, and the chance that it is wrong."""
LEAST = 1e-3
"""Use of friction below which a bound tells nothing."""
COMMON = 0.04
"""Standard deviation of what all measurements have in common, relative: masses, radius."""
OUTLIERS, OUTLIER_NOISE = 0.15, 0.25
"""Share of measurements that tell little, such as of a wheel between two contacts, and their
relative standard deviation."""
WORTHLESS = 0.01
"""Share of measurements that tell nothing."""
CHANGE = 0.002
"""Chance that the ground changes on a metre of way."""
MEMORY = 3.0
"""Way after which a bound has lost a factor e [m]."""
BOUNDED = 0.975
"""Chance of what is below the upper end of an interval; 1 minus this is below the lower end."""
ENOUGH = 0.9
"""Number of independent slips that bound the friction from above."""


@dataclass(frozen=True)
class FrictionEstimate:
    """Friction of the ground with its uncertainty."""

    mean: float
    """Mean: of the told friction given the bound while nothing has slipped."""
    std: float
    """Standard deviation of the same."""
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
        self._prior = np.tile(prior / prior.sum(), (len(TAILS), 1)) / len(TAILS)
        self._chances = self._prior.copy()
        self._bound = 0.0
        self.slips = 0.0
        """Number of independent slips that count, of this ground."""

    def drive(self, way: float) -> None:
        """Take that the rover has gone on some way [m]: the ground may have changed."""
        kept = float(np.exp(-CHANGE * way))
        self._chances = kept * self._chances + (1.0 - kept) * self._prior
        self._bound *= float(np.exp(-way / MEMORY))

    def slip(self, use: float, fluctuation: float, noise: float, weight: float) -> None:
        """Take the shear over the load of a wheel that slips.

        Args:
            use: Shear over load.
            fluctuation: Standard deviation of the wheel's torque over its mean.
            noise: Standard deviation of the use beside NOISE, relative.
            weight: Number of independent measurements that this one is.
        """
        tail = TAILS[:, None] * (STEADY_TAIL + TAIL_PER_FLUCTUATION * fluctuation) * GRID
        usual = _tailed_density(use, np.hypot(NOISE, noise) * GRID, tail)
        rough = _tailed_density(use, np.hypot(OUTLIER_NOISE, noise) * GRID, tail)
        mixed = (1.0 - OUTLIERS - WORTHLESS) * usual + OUTLIERS * rough + WORTHLESS / GRID[-1]
        self._update(weight * np.log(mixed))
        self.slips = min(self.slips + weight, 1e3)

    def grip(self, use: float) -> None:
        """Take the shear over the load of a wheel that grips, which the friction exceeds."""
        if use > max(self._bound, LEAST):
            self._update(_log_chance_above(use) - _log_chance_above(self._bound))
            self._bound = use

    def _update(self, log_likelihood: Floats) -> None:
        chances = self._chances * np.exp(log_likelihood - log_likelihood.max())
        self._chances = chances / chances.sum()

    @property
    def estimate(self) -> FrictionEstimate:
        """Mean, standard deviation and interval."""
        chances = self._chances.sum(axis=0)
        mean = float(chances @ GRID)
        spread = np.hypot(np.sqrt(max(float(chances @ (GRID - mean) ** 2), 0.0)), COMMON * mean)
        below = _widening() @ chances
        low, high = (float(np.interp(p, below, GRID)) for p in (1.0 - BOUNDED, BOUNDED))
        proved = self._bound * (1.0 - 2.0 * BOUND_NOISE)
        if self.slips < ENOUGH:
            return FrictionEstimate(mean, float(spread), min(low, proved), None)
        return FrictionEstimate(mean, float(spread), low, high)


def _tailed_density(use: float, noise: Floats, tail: Floats) -> Floats:
    """Return the density of a use: the friction, less an exponential tail, with normal noise."""
    above = (use - GRID) / noise
    z = (above + noise / tail) / np.sqrt(2.0)
    # exp(-above^2/2) erfcx(z) is the exponentially modified normal density without overflow;
    # far below the friction erfcx overflows, and the density is the plain exponential.
    safe = np.maximum(z, -20.0)
    modified = np.exp(-0.5 * above**2) * erfcx(safe) / (2.0 * tail)
    plain = np.exp(np.minimum((use - GRID) / tail + 0.5 * (noise / tail) ** 2, 0.0)) / tail
    return np.where(z > -20.0, modified, plain)


def _log_chance_above(use: float) -> Floats:
    """Return the logarithm of the chance of feeling this use or more of a gripping wheel."""
    if use < LEAST:
        return np.zeros_like(GRID)
    return np.logaddexp(
        np.log(1.0 - DOUBT) + log_ndtr((GRID - use) / (BOUND_NOISE * use)), np.log(DOUBT)
    )


@lru_cache
def _widening() -> Floats:
    """Return what makes cumulative chances of chances, widened by the common error.

    This error is a normal distribution in the logarithm of the friction.
    """
    return np.asarray(ndtr(np.log(GRID[:, None] / GRID[None, :]) / COMMON))
