"""The limits that a verdict holds a path against: name, unit, value and direction of each."""

from dataclasses import dataclass

import numpy as np

from rover_physics.forces.soil import MODERATE_SINKAGE
from rover_physics.names import SERVO
from rover_physics.prediction.path_prediction import PathPrediction
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

    Those of friction and torque are less the control margin. With speed servos they limit the
    rover as a whole, so that they have no number. Sinkage is left out where nothing sinks.
    """
    limits, kept = rover.limits, 1.0 - prediction.control_margin
    on_servos = prediction.policy == SERVO
    sinks = bool(np.any(prediction.sinkage > 0.0))
    found = [
        Limit(GROUND, "ground"),
        Limit("suspension", "joints"),
        Limit("tilt", "tilt", float(np.degrees(limits.tilt)), "deg", 180.0 / np.pi, digits=1),
        Limit("tip_over", "margin", limits.tip_over_ratio, is_lowest=True),
        Limit("wheel_lift", "load", None if on_servos else 0.0, "N", is_lowest=True, digits=1),
        Limit("friction", "friction", None if on_servos else kept * limits.friction_utilisation),
        Limit("torque", "torque", None if on_servos else kept * limits.torque_saturation),
        Limit("wheel_drop", "drop", 100.0 * limits.wheel_drop, "cm", 100.0, digits=1),
        Limit("belly", "belly", 100.0 * limits.belly_clearance, "cm", 100.0, True, 1),
    ]
    if sinks:
        deepest = 100.0 * MODERATE_SINKAGE * 2.0 * rover.wheel.radius
        found.insert(5, Limit("sinkage", "sinkage", deepest, "cm", 100.0, digits=1))
    return {limit.code: limit for limit in found}
