"""One limit compared with all waypoints of a prediction."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_physics.names import WHEELS
from rover_physics.prediction.path_prediction import PathPrediction

NOT_COMPUTABLE = "not_computable"
"""Code of a value that is not a number; it counts as a broken limit."""
TOLERANCE = 1e-9
"""Excess over a limit, in its unit, that counts as rounding."""


class Check(NamedTuple):
    """Comparison of one limit with all waypoints of a prediction.

    A value that is NaN breaks its limit, apart from the belly clearance over unknown ground.
    """

    code: str
    """Code of the limit in a verdict."""
    extreme: float
    """The value closest to the limit or furthest beyond it; NaN if none is known, or if the limit
    is not a single number."""
    breaks: bool
    """Whether the limit is broken anywhere."""
    broken: Callable[[], np.ndarray]
    """Returns (n,) True where the limit is broken."""
    margins: Callable[[], np.ndarray]
    """Returns the share of the limit that is left, (n,), negative where it is broken."""
    wheels: Callable[[], np.ndarray]
    """Returns the index of the wheel concerned, (n,), -1 for none."""
    describe: Callable[[int], str]
    """Returns the reason of a waypoint, with value and limit."""
    values: np.ndarray
    """(n, ...) the values that are compared."""
    quantity: str
    """Name of the values."""

    def explain(self, row: int) -> tuple[str, str]:
        """Return code and reason of a waypoint where the limit is broken."""
        if np.isnan(self.values[row]).any():
            return NOT_COMPUTABLE, f"{self.quantity} cannot be computed: it is not a number"
        return self.code, self.describe(row)


def compare(value: float, limit: float, digits: int, unit: str = "") -> str:
    """Return "value, limit ..." with enough digits that the two differ."""
    while digits < 9 and f"{value:.{digits}f}" == f"{limit:.{digits}f}":
        digits += 1
    return f"{value:.{digits}f}{unit}, limit {limit:.{digits}f}{unit}"


def share_left(values: np.ndarray, limit: float) -> np.ndarray:
    """Return the share of an upper limit that is left; the difference if the limit is 0."""
    return 1.0 - values / limit if limit > 0.0 else limit - values


def no_wheel(values: np.ndarray) -> Callable[[], np.ndarray]:
    """Return a function of no wheel, -1, for each waypoint."""
    return lambda: np.full(len(values), -1)


def largest_of(values: np.ndarray) -> float:
    """Return the largest value that is not NaN, or NaN if there is none."""
    return float(np.fmax.reduce(values, axis=None)) if values.size else np.nan


def smallest_of(values: np.ndarray) -> float:
    """Return the smallest value that is not NaN, or NaN if there is none."""
    return float(np.fmin.reduce(values, axis=None)) if values.size else np.nan


def largest_and_sure(values: np.ndarray) -> tuple[float, bool]:
    """Return `largest_of` the values, and whether none of them is NaN."""
    if not values.size:
        return np.nan, True
    largest = float(np.maximum.reduce(values, axis=None))
    return (largest, True) if largest == largest else (largest_of(values), False)


def smallest_and_sure(values: np.ndarray) -> tuple[float, bool]:
    """Return `smallest_of` the values, and whether none of them is NaN."""
    if not values.size:
        return np.nan, True
    smallest = float(np.minimum.reduce(values, axis=None))
    return (smallest, True) if smallest == smallest else (smallest_of(values), False)


def check_wheels(
    code: str, values: np.ndarray, limit: float, words: str, digits: int = 2, unit: str = ""
) -> Check:
    """Return the check that no value (n, 6) of a wheel is above a limit."""

    def describe(i: int) -> str:
        wheel = int(np.argmax(values[i]))
        return f"{WHEELS[wheel]} {words} {compare(values[i, wheel], limit, digits, unit)}"

    extreme, sure = largest_and_sure(values)
    return Check(
        code,
        extreme,
        not sure or extreme > limit + TOLERANCE,
        lambda: ~np.all(values <= limit + TOLERANCE, axis=1),
        lambda: share_left(np.max(values, axis=1), limit),
        lambda: np.argmax(values, axis=1),
        describe,
        values,
        f"{code.replace('_', ' ')} of a wheel",
    )


def check_wheel_lift(prediction: PathPrediction) -> Check:
    """Return the check that no wheel load is negative."""
    loads = prediction.wheel_loads

    def describe(i: int) -> str:
        wheel = int(np.argmin(loads[i]))
        return (
            f"{WHEELS[wheel]} wheel lifts off: load {loads[i, wheel]:.2f} N "
            f"under {prediction.policy} torques"
        )

    def margins() -> np.ndarray:
        share = loads.min(axis=1) / np.maximum(loads.sum(axis=1) / 6.0, TOLERANCE)
        return np.asarray(share)

    least, sure = smallest_and_sure(loads)
    return Check(
        "wheel_lift",
        least,
        not sure or least < 0.0,
        lambda: ~np.all(loads >= 0.0, axis=1),
        margins,
        lambda: np.argmin(loads, axis=1),
        describe,
        loads,
        "wheel load",
    )
