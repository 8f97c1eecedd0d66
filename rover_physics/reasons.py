"""Each limit held against a prediction: where it is broken, and in which words that is told."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_physics.names import SIDES, WHEELS
from rover_physics.prediction import PathPrediction
from rover_physics.rover import Rover
from rover_physics.soil import MODERATE_SINKAGE

TOLERANCE = 1e-9


class Check(NamedTuple):
    """One limit held against all waypoints of a prediction."""

    code: str
    """Its code in a verdict."""
    broken: np.ndarray
    """(n,) True where the limit is broken."""
    margins: Callable[[], np.ndarray]
    """Gives the share of the limit (n,) that is left, negative where it is broken."""
    wheels: Callable[[], np.ndarray]
    """Gives the index of the wheel (n,) that it is about, -1 for none."""
    describe: Callable[[int], str]
    """Says of a waypoint by how much."""


def tilt_of(prediction: PathPrediction) -> np.ndarray:
    """Return the angle (n,) [rad] between the body's z axis and the vertical."""
    upright = np.cos(prediction.roll) * np.cos(prediction.pitch)
    return np.arccos(np.clip(upright, -1.0, 1.0))


def compare(value: float, limit: float, digits: int, unit: str = "") -> str:
    """Return "value, limit ..." with as many digits as it takes to tell the two apart."""
    while digits < 9 and f"{value:.{digits}f}" == f"{limit:.{digits}f}":
        digits += 1
    return f"{value:.{digits}f}{unit}, limit {limit:.{digits}f}{unit}"


def _share_left(values: np.ndarray, limit: float) -> np.ndarray:
    """Return the share of an upper limit that is left; the amount where the limit is 0."""
    return 1.0 - values / limit if limit > 0.0 else limit - values


def _no_wheel(values: np.ndarray) -> Callable[[], np.ndarray]:
    return lambda: np.full(len(values), -1)


def check_limits(rover: Rover, prediction: PathPrediction) -> list[Check]:
    """Return the checks of a prediction, the most telling reason first."""
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
    suspension = rover.suspension
    joints = np.hstack([prediction.rocker_angle, prediction.bogie_angle])
    low = np.repeat([suspension.rocker_limits[0], suspension.bogie_limits[0]], 2)
    high = np.repeat([suspension.rocker_limits[1], suspension.bogie_limits[1]], 2)
    beyond = (joints < low - TOLERANCE) | (joints > high + TOLERANCE)

    def margins() -> np.ndarray:
        left = np.minimum(joints - low, high - joints) / (high - low)
        return np.asarray(left.min(axis=1))

    def describe(i: int) -> str:
        joint = int(np.argmax(beyond[i]))
        name = f"{SIDES[joint % 2]} {('rocker', 'bogie')[joint // 2]}"
        limit = low[joint] if joints[i, joint] < low[joint] else high[joint]
        return f"{name} angle {compare(joints[i, joint], limit, 2, ' rad')}"

    return Check("suspension", np.any(beyond, axis=1), margins, _no_wheel(joints), describe)


def _check_tilt(rover: Rover, prediction: PathPrediction) -> Check:
    tilt, limit = np.degrees(tilt_of(prediction)), np.degrees(rover.limits.tilt)

    def describe(i: int) -> str:
        return f"tilt {compare(tilt[i], limit, 1, ' deg')}"

    return Check(
        "tilt",
        tilt > limit + TOLERANCE,
        lambda: _share_left(tilt, limit),
        _no_wheel(tilt),
        describe,
    )


def _check_tip_over(rover: Rover, prediction: PathPrediction) -> Check:
    ratio, limit = prediction.tip_over_ratio, rover.limits.tip_over_ratio

    def describe(i: int) -> str:
        return f"tip-over ratio {compare(ratio[i], limit, 2)}"

    return Check(
        "tip_over",
        ratio < limit - TOLERANCE,
        lambda: -_share_left(ratio, limit),
        _no_wheel(ratio),
        describe,
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

    broken = np.any(loads < 0.0, axis=1)
    return Check("wheel_lift", broken, margins, lambda: np.argmin(loads, axis=1), describe)


def _check_sinkage(rover: Rover, prediction: PathPrediction) -> Check:
    limit = MODERATE_SINKAGE * 2.0 * rover.wheel.radius
    words = "wheel sinks deeper than the soil model holds: sinkage"
    return _check_wheels("sinkage", prediction.sinkage, limit, words, 3, " m")


def _check_friction(rover: Rover, prediction: PathPrediction) -> Check:
    limit = rover.limits.friction_utilisation
    words = "wheel slips: friction utilisation"
    return _check_wheels("friction", prediction.friction_utilisation, limit, words)


def _check_torque(rover: Rover, prediction: PathPrediction) -> Check:
    limit = rover.limits.torque_saturation
    words = "motor saturates: torque saturation"
    return _check_wheels("torque", prediction.torque_saturation, limit, words)


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

    return Check(
        code,
        np.any(values > limit + TOLERANCE, axis=1),
        lambda: _share_left(np.max(values, axis=1), limit),
        lambda: np.argmax(values, axis=1),
        describe,
    )


def _check_belly(rover: Rover, prediction: PathPrediction) -> Check:
    clearance, limit = prediction.belly_clearance, rover.limits.belly_clearance

    def describe(i: int) -> str:
        return f"belly clearance {compare(clearance[i], limit, 3, ' m')}"

    return Check(
        "belly",
        clearance < limit - TOLERANCE,
        lambda: -_share_left(clearance, limit),
        _no_wheel(clearance),
        describe,
    )
