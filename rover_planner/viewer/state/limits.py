# SPDX-License-Identifier: Apache-2.0
"""The limits of a rover as people read them: one for each code, with title, bound and unit."""

from dataclasses import dataclass

import numpy as np

from rover_physics.limits.table import RATIO, Sense, Unit
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import limits_of
from rover_physics.rover.model import Rover

GROUND = "ground"
"""Code of what is no limit of a number: unknown ground, no equilibrium, entrapment, steering."""
MAX_DIGITS = 6
"""Most digits behind the point that tell a value from its limit."""


@dataclass(frozen=True)
class ShownLimit:
    """One limit of a rover; its numbers are in the unit that people read."""

    code: str
    """Code of a verdict, or GROUND."""
    title: str
    """Short name."""
    bound: float | None = None
    """Largest or smallest good value; None if it is not a single number."""
    unit: Unit = RATIO
    """Unit of bound and values."""
    is_lowest: bool = False
    """True if the bound is the smallest good value, not the largest."""

    def is_broken_by(self, value: float) -> bool:
        """Return whether a value is beyond the limit; False if it is no single number.

        The worst case of an uncertain map may break a limit that the value itself keeps.
        """
        if self.bound is None:
            return False
        return value < self.bound if self.is_lowest else value > self.bound

    def write(self, value: float, digits: int | None = None) -> str:
        """Return a value as text, without the unit; ? for NaN."""
        if np.isfinite(value):
            return f"{value:.{self.unit.digits if digits is None else digits}f}"
        return "?" if np.isnan(value) else "infinite"

    def compare(self, value: float) -> str:
        """Return a value beside the limit, such as "friction 1.32 of 1.00", with enough digits."""
        if self.bound is None:
            return self.title
        digits = self.unit.digits
        while digits < MAX_DIGITS and self.write(value, digits) == self.write(self.bound, digits):
            digits += 1
        word = "of at least" if self.is_lowest else "of"
        shown, bound = self.write(value, digits), self.write(self.bound, digits)
        return f"{self.title} {shown} {word} {bound} {self.unit.name}".strip()


def list_limits(rover: Rover, prediction: PathPrediction) -> dict[str, ShownLimit]:
    """Return the limits by code for a prediction, in the order in which they become reasons.

    Those of friction and torque are less the control margin. Sinkage is left out where nothing
    sinks. Rows of the table with one code are one limit, which is a number if it is one row's.
    """
    asked = limits_of(rover, prediction.policy)
    found: dict[str, ShownLimit] = {}
    for row, bound in zip(asked.rows, asked.bounds, strict=True):
        if row.code == "sinkage" and not np.any(prediction.sinkage > 0.0):
            continue
        if row.code in found or row.sense == Sense.RANGE:
            found[row.code] = ShownLimit(row.code, row.title)
            continue
        unit = row.shown or row.unit
        bound *= unit.factor * (1.0 - prediction.control_margin if row.keeps_margin else 1.0)
        is_lowest = row.sense in (Sense.LEAST, Sense.SHARE)
        found[row.code] = ShownLimit(row.code, row.title, bound, unit, is_lowest)
    return {GROUND: ShownLimit(GROUND, "ground"), **found}
