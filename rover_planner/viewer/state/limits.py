# SPDX-License-Identifier: Apache-2.0
"""The limits of a rover as people read them: one for each code, with title, bound and unit."""

from dataclasses import dataclass, replace

import numpy as np

from rover_physics.limits.table import RATIO, Sense, Unit
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import limits_of
from rover_physics.rover.model import Rover

GROUND = "ground"
"""Code of what is no limit of a number: unknown ground, no equilibrium, entrapment, steering."""
MAX_USE = 99.0
"""Largest use that is written as a number."""
MORE_DIGITS = 2
"""Most digits beyond those of the unit that tell a value from its limit; else words do."""


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
    keeps_margin: bool = False
    """True if a control margin reduces the bound."""

    def keep(self, share: float) -> "ShownLimit":
        """Return the limit of which a share is kept, if a control margin reduces it."""
        if self.bound is None or not self.keeps_margin:
            return self
        return replace(self, bound=share * self.bound)

    def is_broken_by(self, value: float) -> bool:
        """Return whether a value is beyond the limit; False if it is no single number.

        The worst case of an uncertain map may break a limit that the value itself keeps.
        """
        if self.bound is None:
            return False
        return value < self.bound if self.is_lowest else value > self.bound

    def write(self, value: float, more: int = 0) -> str:
        """Return a value as text, without the unit and with more digits; ? for NaN."""
        if np.isfinite(value):
            return f"{value:.{self.unit.digits + more}f}"
        return "?" if np.isnan(value) else "infinite"

    def compare(self, value: float) -> str:
        """Return a value beside the limit, such as "friction 1.32 of 1.00", with enough digits.

        Where MORE_DIGITS do not tell them apart, words do: "friction just above 1.00".
        """
        if self.bound is None:
            return self.title
        unit, bound = f" {self.unit.name}".rstrip(), self.bound
        for more in range(MORE_DIGITS + 1):
            shown, limit = self.write(value, more), self.write(bound, more)
            if shown != limit:
                least = "at least " if self.is_lowest else ""
                return f"{self.title} {shown} of {least}{limit}{unit}"
        side = "at" if value == bound else "just above" if value > bound else "just below"
        return f"{self.title} {side} {self.write(bound)}{unit}"

    @property
    def good(self) -> str:
        """Good values with their unit, such as "max 1.00"; empty if it is no single number."""
        if self.bound is None:
            return ""
        word = "min" if self.is_lowest else "max"
        return f"{word} {self.write(self.bound)} {self.unit.name}".strip()


def write_use(use: float) -> str:
    """Return the use of a limit as text, such as "76 %"."""
    if np.isnan(use):
        return "not asked"
    if use > MAX_USE:
        return "fails" if np.isinf(use) else f"over {100.0 * MAX_USE:.0f} %"
    text = f"{100.0 * use:.0f} %"
    return "just above 100 %" if use > 1.0 and text == "100 %" else text


def list_limits(rover: Rover, prediction: PathPrediction) -> dict[str, ShownLimit]:
    """Return the limits by code for a prediction, in the order in which they become reasons.

    Sinkage is left out where nothing
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
        is_lowest = row.sense in (Sense.LEAST, Sense.SHARE)
        found[row.code] = ShownLimit(
            row.code, row.title, unit.factor * bound, unit, is_lowest, row.keeps_margin
        )
    return {GROUND: ShownLimit(GROUND, "ground"), **found}
