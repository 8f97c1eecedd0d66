# SPDX-License-Identifier: Apache-2.0
"""The limits of a rover: one row each, from which verdicts, surveys, searches and lanes follow.

A new limit is one row of LIMITS. If its bound is a number of the rover file, the row names its
`key` below `limits:`, and a rover file that has the key is asked for it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from rover_physics.names import CONTROL_POLICIES, SERVO, SIDES, TORQUE_POLICIES
from rover_physics.status import Stall

MODERATE_SINKAGE = 1.0 / 6.0
"""Largest sinkage [wheel diameters] at which the sinkage formula holds, according to Wong."""
MIN_SPEED_SHARE = 0.05
"""Least share of the commanded motion with which a rover drives. A servo at its torque limit still
turns; below this share the rover grinds on the spot."""
RUNAWAY = 0.1
"""Height [wheel radii] of the fall whose speed a rover may reach that its motors cannot hold:
0.44 m/s on Earth with wheels of 0.1 m."""
MAX_TURN_OFF = 0.1
"""Largest turn [rad] off its path that a rover with speed servos may make within its wheelbase: a
curvature error that would double the width of its track within about two lengths."""
MAX_SLIDE = 0.2
"""Largest distance [wheelbases] that it may slide off its path within its wheelbase: a slip angle
of 11 degrees."""
TOLERANCE = 1e-9
"""Excess over a limit, in its SI unit, that counts as rounding."""
TRAPPED = "trapped"
"""Code of a path that leads to where the rover gets neither on nor back."""
CHANCE = "chance"
"""Code of a path that keeps all limits as told, but breaks one with too large a chance."""
NOT_COMPUTABLE = "not_computable"
"""Code of a value that is not a number; it counts as a broken limit."""
WHEEL_CONSTRAINTS = ("wheel_lift", "friction", "torque")
"""Codes of the paper's three constraints."""

Bound = float | tuple[float, float] | None


class Sense(IntEnum):
    """Comparison of a value with its bound, which defines the use of the limit."""

    MOST = 0
    """The bound is the largest good value; use = value / bound."""
    LEAST = 1
    """The bound is the smallest good value; use = bound / value."""
    RANGE = 2
    """Two bounds; the use is 0 in the middle between them and 1 at either."""
    SHARE = 3
    """The smallest good value is 0, and the use is 0 at the mean of the row's values."""


@dataclass(frozen=True)
class Unit:
    """Unit, factor and digits in which a number is shown to people."""

    name: str = ""
    """Unit, empty for a ratio."""
    digits: int = 2
    """Digits behind the point."""
    factor: float = 1.0
    """The value in SI units times this is in this unit."""

    def write(self, value: float, digits: int | None = None) -> str:
        """Return a value in SI units as text, with the unit."""
        unit = f" {self.name}" if self.name else ""
        return f"{self.factor * value:.{self.digits if digits is None else digits}f}{unit}"

    def compare(self, value: float, bound: float) -> str:
        """Return "value, limit ..." with enough digits that the two differ."""
        digits = self.digits
        while digits < 9 and self.write(value, digits) == self.write(bound, digits):
            digits += 1
        return f"{self.write(value, digits)}, limit {self.write(bound, digits)}"


RATIO = Unit()
RADIANS = Unit("rad")
DEGREES = Unit("deg", 1, 57.29577951308232)
METRES = Unit("m", 3)
CENTIMETRES = Unit("cm", 1, 100.0)
NEWTONS = Unit("N", 2)


@dataclass(frozen=True)
class Limit:
    """One limit of a rover."""

    code: str
    """Code in a verdict; rows with one code are one limit to people."""
    reads: str
    """Quantity of a result that is held against the bound."""
    words: str
    """Reason of a row that breaks it; {element} is the wheel, or the side of a joint, {value} its
    value, {compared} value and bound, {policy} the torque policy."""
    title: str
    """Short name of the code."""
    bound: Callable[[Any], Bound] | None = None
    """Returns the bound for a `Rover` in SI units, two of them for a RANGE, or None where it is
    not asked; absent: the number `key` of the rover file."""
    sense: Sense = Sense.MOST
    """Comparison of the value with its bound."""
    key: str = ""
    """Its optional number below `limits:` of a rover file; empty if its bound is none."""
    unit: Unit = RATIO
    """Unit in reasons."""
    shown: Unit | None = None
    """Unit on the page; None: as in reasons."""
    has_number: bool = True
    """True if value and bound are numbers that people compare."""
    wheel_of: str = ""
    """Quantity whose largest value names a wheel, if the limit reads no values of wheels."""
    elements: tuple[str, ...] = ()
    """Names of the elements of the quantity if they are no wheels."""
    policies: tuple[str, ...] = TORQUE_POLICIES
    """Torque policies under which it is asked."""
    only_if: tuple[str, float] | None = None
    """A quantity and its value: the limit is asked only where the quantity has it."""
    needs_forces: bool = False
    """True if it depends on the torque policy; else a failure is one under every policy."""
    exempt_on_edge: bool = False
    """True if it is not asked while a wheel rolls off an edge, which needs no equilibrium."""
    keeps_margin: bool = False
    """True if a control margin reduces its bound."""
    is_risk: bool = False
    """True if its use counts as risk when paths are compared."""
    may_be_unknown: bool = False
    """True if the limit is not asked where its value is NaN; else NaN breaks it."""

    def find_bound(self, rover: Any) -> Bound:
        """Return the bound for a `Rover`, None where it is not asked."""
        if self.bound is None:
            return rover.limits.further.get(self.key)  # type: ignore[no-any-return]
        return self.bound(rover)


FORCES: dict[str, Any] = {"needs_forces": True, "exempt_on_edge": True}
ON_TORQUES: dict[str, Any] = {"policies": CONTROL_POLICIES, **FORCES}
ON_SERVOS: dict[str, Any] = {"policies": (SERVO,), **FORCES}

LIMITS: tuple[Limit, ...] = (
    Limit(
        "suspension", "rocker_angle", "{element} rocker angle {compared}", "joints",
        lambda rover: rover.suspension.rocker_limits, Sense.RANGE,
        unit=RADIANS, elements=SIDES,
    ),
    Limit(
        "suspension", "bogie_angle", "{element} bogie angle {compared}", "joints",
        lambda rover: rover.suspension.bogie_limits, Sense.RANGE,
        unit=RADIANS, elements=SIDES,
    ),
    Limit(
        "tilt", "tilt", "tilt {compared}", "tilt",
        lambda rover: rover.limits.tilt, unit=DEGREES, is_risk=True,
    ),
    Limit(
        "tip_over", "tip_over_ratio", "tip-over ratio {compared}", "margin",
        lambda rover: rover.limits.tip_over_ratio, Sense.LEAST, is_risk=True,
    ),
    Limit(
        "wheel_lift", "wheel_loads",
        "{element} wheel lifts off: load {value} under {policy} torques", "load",
        lambda rover: 0.0, Sense.SHARE, unit=NEWTONS, shown=Unit("N", 1), **FORCES,
    ),
    Limit(
        "wheel_lift", "lift_height", "{element} wheel lifts off the ground: {compared}", "load",
        lambda rover: rover.wheel.radius, unit=Unit("m", 2), **ON_SERVOS,
    ),
    Limit(
        "sinkage", "sinkage",
        "{element} wheel sinks deeper than the soil model holds: sinkage {compared}", "sinkage",
        lambda rover: MODERATE_SINKAGE * 2.0 * rover.wheel.radius,
        unit=METRES, shown=CENTIMETRES, **FORCES,
    ),
    Limit(
        "friction", "friction_utilisation",
        "{element} wheel slips: friction utilisation {compared}", "friction",
        lambda rover: rover.limits.friction_utilisation,
        keeps_margin=True, is_risk=True, **ON_TORQUES,
    ),
    # With speed servos, wheels may slide or saturate while the others drive the rover: friction
    # and torque limit the rover as a whole.
    Limit(
        "friction", "turn_off", "rover turns off its path: {compared}", "friction",
        lambda rover: MAX_TURN_OFF, unit=RADIANS, **ON_SERVOS,
    ),
    Limit(
        "friction", "slide_off", "rover slides off its path: {compared}", "friction",
        lambda rover: MAX_SLIDE * rover.wheelbase, unit=Unit("m", 2), **ON_SERVOS,
    ),
    Limit(
        "friction", "speed_share", "a wheel is wedged between faces in front and behind",
        "friction", lambda rover: MIN_SPEED_SHARE, Sense.LEAST, has_number=False,
        only_if=("stalls", Stall.WEDGED), wheel_of="friction_utilisation", **FORCES,
    ),
    Limit(
        "friction", "speed_share", "no forward speed balances: the wheels slide", "friction",
        lambda rover: MIN_SPEED_SHARE, Sense.LEAST, has_number=False,
        only_if=("stalls", Stall.NONE), wheel_of="friction_utilisation", **ON_SERVOS,
    ),
    Limit(
        "friction", "friction_share", "all friction is used: {compared}", "friction",
        lambda rover: 1.0, has_number=False, wheel_of="friction_utilisation", **ON_SERVOS,
    ),
    Limit(
        "torque", "torque_saturation",
        "{element} motor saturates: torque saturation {compared}", "torque",
        lambda rover: rover.limits.torque_saturation,
        keeps_margin=True, is_risk=True, **ON_TORQUES,
    ),
    Limit(
        "torque", "speed_share",
        "no forward speed balances: the motors stall at their largest torque", "torque",
        lambda rover: MIN_SPEED_SHARE, Sense.LEAST, has_number=False,
        only_if=("stalls", Stall.STALLED), wheel_of="torque_saturation", **ON_SERVOS,
    ),
    Limit(
        "torque", "speed_share", "the motors cannot hold the rover: it runs away", "torque",
        lambda rover: MIN_SPEED_SHARE, Sense.LEAST, has_number=False,
        only_if=("stalls", Stall.RUNS_AWAY), wheel_of="torque_saturation", **ON_SERVOS,
    ),
    Limit(
        "torque", "torque_share", "all torque is used: {compared}", "torque",
        lambda rover: 1.0, has_number=False, wheel_of="torque_saturation", **ON_SERVOS,
    ),
    Limit(
        "wheel_drop", "wheel_drop", "{element} wheel drops off an edge: {compared}", "drop",
        lambda rover: rover.limits.wheel_drop, unit=METRES, shown=CENTIMETRES,
    ),
    Limit(
        "belly", "belly_clearance", "belly clearance {compared}", "belly",
        lambda rover: rover.limits.belly_clearance, Sense.LEAST, unit=METRES, shown=CENTIMETRES,
        is_risk=True, may_be_unknown=True,
    ),
)  # fmt: skip
"""All limits, in the order in which they become the reason of a row."""
