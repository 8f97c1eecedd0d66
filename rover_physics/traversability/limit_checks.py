"""Checks of a prediction against each limit: where it is broken, and the text of the reason."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_physics.forces.soil import MODERATE_SINKAGE
from rover_physics.names import SIDES, WHEELS
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.rover.model import Rover

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


def tilt_of(prediction: PathPrediction) -> np.ndarray:
    """Return the angle (n,) [rad] between the body's z axis and the vertical."""
    upright = np.cos(prediction.roll) * np.cos(prediction.pitch)
    return np.arccos(np.minimum(np.maximum(upright, -1.0), 1.0))


def compare(value: float, limit: float, digits: int, unit: str = "") -> str:
    """Return "value, limit ..." with enough digits that the two differ."""
    while digits < 9 and f"{value:.{digits}f}" == f"{limit:.{digits}f}":
        digits += 1
    return f"{value:.{digits}f}{unit}, limit {limit:.{digits}f}{unit}"


def _share_left(values: np.ndarray, limit: float) -> np.ndarray:
    """Return the share of an upper limit that is left; the difference if the limit is 0."""
    return 1.0 - values / limit if limit > 0.0 else limit - values


def _no_wheel(values: np.ndarray) -> Callable[[], np.ndarray]:
    return lambda: np.full(len(values), -1)


def largest_of(values: np.ndarray) -> float:
    """Return the largest value that is not NaN, or NaN if there is none."""
    return float(np.fmax.reduce(values, axis=None)) if values.size else np.nan


def smallest_of(values: np.ndarray) -> float:
    """Return the smallest value that is not NaN, or NaN if there is none."""
    return float(np.fmin.reduce(values, axis=None)) if values.size else np.nan


def _largest_and_sure(values: np.ndarray) -> tuple[float, bool]:
    """Return `largest_of` the values, and whether none of them is NaN."""
    if not values.size:
        return np.nan, True
    largest = float(np.maximum.reduce(values, axis=None))
    return (largest, True) if largest == largest else (largest_of(values), False)


def _smallest_and_sure(values: np.ndarray) -> tuple[float, bool]:
    """Return `smallest_of` the values, and whether none of them is NaN."""
    if not values.size:
        return np.nan, True
    smallest = float(np.minimum.reduce(values, axis=None))
    return (smallest, True) if smallest == smallest else (smallest_of(values), False)


def check_limits(rover: Rover, prediction: PathPrediction) -> list[Check]:
    """Return the checks of a prediction, in the order in which they become reasons."""
    return [
        _check_suspension(rover, prediction),
        _check_tilt(rover, prediction),
        _check_tip_over(rover, prediction),
        _check_wheel_lift(prediction),
        _check_sinkage(rover, prediction),
        _check_friction(rover, prediction),
        _check_torque(rover, prediction),
        _check_wheel_drop(rover, prediction),
        _check_belly(rover, prediction),
    ]


def _check_suspension(rover: Rover, prediction: PathPrediction) -> Check:
    rocker, bogie = prediction.rocker_angle, prediction.bogie_angle
    limits = rover.suspension.rocker_limits, rover.suspension.bogie_limits
    breaks = bool(rocker.size) and not all(
        np.minimum.reduce(angle, axis=None) >= least - TOLERANCE
        and np.maximum.reduce(angle, axis=None) <= most + TOLERANCE
        for angle, (least, most) in zip((rocker, bogie), limits, strict=True)
    )

    def joints_and_limits() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        low, high = np.repeat(limits, 2, axis=0).T
        return np.hstack([rocker, bogie]), low, high

    def beyond() -> np.ndarray:
        joints, low, high = joints_and_limits()
        return ~((joints >= low - TOLERANCE) & (joints <= high + TOLERANCE))

    def margins() -> np.ndarray:
        joints, low, high = joints_and_limits()
        left = np.minimum(joints - low, high - joints) / (high - low)
        return np.asarray(left.min(axis=1))

    def describe(i: int) -> str:
        joints = np.hstack([rocker[i], bogie[i]])  # not all rows: a path may have thousands
        low, high = np.repeat(limits, 2, axis=0).T
        joint = int(np.argmax((joints < low - TOLERANCE) | (joints > high + TOLERANCE)))
        name = f"{SIDES[joint % 2]} {('rocker', 'bogie')[joint // 2]}"
        limit = low[joint] if joints[joint] < low[joint] else high[joint]
        return f"{name} angle {compare(joints[joint], limit, 2, ' rad')}"

    return Check(
        "suspension",
        np.nan,
        breaks,
        lambda: np.any(beyond(), axis=1),
        margins,
        _no_wheel(rocker),
        describe,
        np.hstack([rocker, bogie]) if breaks else rocker,
        "suspension angle",
    )


def _check_tilt(rover: Rover, prediction: PathPrediction) -> Check:
    tilt, limit = tilt_of(prediction), np.degrees(rover.limits.tilt)
    extreme, sure = _largest_and_sure(tilt)

    def describe(i: int) -> str:
        return f"tilt {compare(np.degrees(tilt[i]), limit, 1, ' deg')}"

    return Check(
        "tilt",
        extreme,
        not sure or bool(np.degrees(extreme) > limit + TOLERANCE),
        lambda: ~(np.degrees(tilt) <= limit + TOLERANCE),
        lambda: _share_left(np.degrees(tilt), limit),
        _no_wheel(tilt),
        describe,
        tilt,
        "tilt",
    )


def _check_tip_over(rover: Rover, prediction: PathPrediction) -> Check:
    ratio, limit = prediction.tip_over_ratio, rover.limits.tip_over_ratio

    def describe(i: int) -> str:
        return f"tip-over ratio {compare(ratio[i], limit, 2)}"

    extreme, sure = _smallest_and_sure(ratio)
    return Check(
        "tip_over",
        extreme,
        not sure or extreme < limit - TOLERANCE,
        lambda: ~(ratio >= limit - TOLERANCE),
        lambda: -_share_left(ratio, limit),
        _no_wheel(ratio),
        describe,
        ratio,
        "tip-over ratio",
    )


def _check_wheel_lift(prediction: PathPrediction) -> Check:
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

    least, sure = _smallest_and_sure(loads)
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


def _check_sinkage(rover: Rover, prediction: PathPrediction) -> Check:
    limit = MODERATE_SINKAGE * 2.0 * rover.wheel.radius
    words = "wheel sinks deeper than the soil model holds: sinkage"
    return _check_wheels("sinkage", prediction.sinkage, limit, words, 3, " m")


def _check_friction(rover: Rover, prediction: PathPrediction) -> Check:
    limit, margin = rover.limits.friction_utilisation, prediction.control_margin
    words = "wheel slips: friction utilisation"
    check = _check_wheels(
        "friction", prediction.friction_utilisation, limit * (1.0 - margin), words
    )
    return _name_margin(check, limit, margin)


def _check_torque(rover: Rover, prediction: PathPrediction) -> Check:
    limit, margin = rover.limits.torque_saturation, prediction.control_margin
    words = "motor saturates: torque saturation"
    check = _check_wheels("torque", prediction.torque_saturation, limit * (1.0 - margin), words)
    return _name_margin(check, limit, margin)


def _name_margin(check: Check, limit: float, margin: float) -> Check:
    """Return a check whose reasons say that its limit is `limit` less the control margin."""
    if margin == 0.0:
        return check

    def describe(i: int) -> str:
        return f"{check.describe(i)} ({limit:g} less control margin {margin:g})"

    return check._replace(describe=describe)


def _check_wheel_drop(rover: Rover, prediction: PathPrediction) -> Check:
    limit = rover.limits.wheel_drop
    words = "wheel drops off an edge:"
    return _check_wheels("wheel_drop", prediction.wheel_drop, limit, words, 3, " m")


def _check_wheels(
    code: str, values: np.ndarray, limit: float, words: str, digits: int = 2, unit: str = ""
) -> Check:
    def describe(i: int) -> str:
        wheel = int(np.argmax(values[i]))
        return f"{WHEELS[wheel]} {words} {compare(values[i, wheel], limit, digits, unit)}"

    extreme, sure = _largest_and_sure(values)
    return Check(
        code,
        extreme,
        not sure or extreme > limit + TOLERANCE,
        lambda: ~np.all(values <= limit + TOLERANCE, axis=1),
        lambda: _share_left(np.max(values, axis=1), limit),
        lambda: np.argmax(values, axis=1),
        describe,
        values,
        f"{code.replace('_', ' ')} of a wheel",
    )


def _check_belly(rover: Rover, prediction: PathPrediction) -> Check:
    clearance, limit = prediction.belly_clearance, rover.limits.belly_clearance

    def describe(i: int) -> str:
        return f"belly clearance {compare(clearance[i], limit, 3, ' m')}"

    # NaN over unknown ground breaks no limit: few rovers see the ground below themselves.
    extreme = smallest_of(clearance)
    return Check(
        "belly",
        extreme,
        extreme < limit - TOLERANCE,
        lambda: clearance < limit - TOLERANCE,
        lambda: -_share_left(clearance, limit),
        _no_wheel(clearance),
        describe,
        clearance,
        "belly clearance",
    )
