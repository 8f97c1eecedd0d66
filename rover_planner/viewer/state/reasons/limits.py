# SPDX-License-Identifier: Apache-2.0
"""The limits that a verdict holds a path against: name, unit, value and direction of each."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.limits.table import Limit as LimitRow
from rover_physics.limits.table import Sense
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import limits_of
from rover_physics.rover.model import Rover

GROUND = "ground"
"""Code of what is no limit of a number: unknown ground, no equilibrium, entrapment, steering."""
WAYS = {
    "steering": "steering",
    "off_map": "off the map",
    "unknown_ground": "unknown ground",
    "not_settled": "does not settle",
    "no_equilibrium": "no equilibrium",
    "not_computable": "not computable",
    "trapped": "trapped",
}
"""Words for the codes of a verdict that have no number."""


@dataclass(frozen=True)
class Limit:
    """One limit of a rover."""

    code: str
    """Code of a verdict, or GROUND."""
    title: str
    """Short name."""
    bound: float | None = None
    """Value of the limit in `unit`; None if it is not a single number."""
    unit: str = ""
    """Unit for people, empty for none."""
    factor: float = 1.0
    """Values in SI units times this are in `unit`."""
    is_lowest: bool = False
    """Whether the limit is the smallest good value, not the largest."""
    digits: int = 2
    """Digits that are shown behind the point."""

    def is_broken_by(self, value: float) -> bool:
        """Return whether a value in `unit` is beyond the limit; False if it is no single number.

        The worst case of an uncertain map may break a limit that the value itself keeps.
        """
        if self.bound is None or np.isnan(value):
            return False
        return value < self.bound if self.is_lowest else value > self.bound

    def write(self, value: float) -> str:
        """Return a value in `unit` as text, without the unit; ? for NaN."""
        if np.isnan(value):
            return "?"
        return f"{value:.{self.digits}f}" if np.isfinite(value) else "infinite"

    def compare(self, value: float) -> str:
        """Return a value beside the limit, such as "friction 1.32 of 1.00", with enough digits."""
        if self.bound is None:
            return self.title
        digits = self.digits
        while digits < 6 and f"{value:.{digits}f}" == f"{self.bound:.{digits}f}" != "":
            digits += 1
        shown = f"{value:.{digits}f}" if np.isfinite(value) else "infinite"
        word = "of at least" if self.is_lowest else "of"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.title} {shown} {word} {self.bound:.{digits}f}{unit}"


def list_limits(rover: Rover, prediction: PathPrediction) -> dict[str, Limit]:
    """Return the limits by code for a prediction, in the order in which they become reasons.

    Those of friction and torque are less the control margin. Sinkage is left out where nothing
    sinks.
    """
    asked = limits_of(rover, prediction.policy)
    found = {GROUND: Limit(GROUND, "ground")}
    for code in dict.fromkeys(row.code for row in asked.rows):
        if code == "sinkage" and not np.any(prediction.sinkage > 0.0):
            continue
        rows = [
            (row, bound)
            for row, bound in zip(asked.rows, asked.bounds, strict=True)
            if row.code == code
        ]
        found[code] = _show(rows, 1.0 - prediction.control_margin)
    return found


def _show(rows: list[tuple[LimitRow, Any]], kept: float) -> Limit:
    """Return the limit that rows of one code are to people: a number if it is one row's."""
    row, bound = rows[0]
    if len(rows) > 1 or row.sense == Sense.RANGE:
        return Limit(row.code, row.title)
    unit = row.shown or row.unit
    bound *= unit.factor * (kept if row.keeps_margin else 1.0)
    is_lowest = row.sense in (Sense.LEAST, Sense.SHARE)
    return Limit(row.code, row.title, bound, unit.name, unit.factor, is_lowest, unit.digits)
