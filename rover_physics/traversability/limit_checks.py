"""Checks of a prediction against each limit: where it is broken, and the text of the reason."""

import numpy as np

from rover_physics.forces.soil import MODERATE_SINKAGE
from rover_physics.names import SERVO, SIDES
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.traversability.check import (
    TOLERANCE,
    Check,
    check_wheel_lift,
    check_wheels,
    compare,
    largest_and_sure,
    no_wheel,
    share_left,
    smallest_and_sure,
    smallest_of,
)
from rover_physics.traversability.servo_checks import (
    check_servo_friction,
    check_servo_lift,
    check_servo_torque,
)


def tilt_of(prediction: PathPrediction) -> np.ndarray:
    """Return the angle (n,) [rad] between the body's z axis and the vertical."""
    upright = np.cos(prediction.roll) * np.cos(prediction.pitch)
    return np.arccos(np.minimum(np.maximum(upright, -1.0), 1.0))


def check_limits(rover: Rover, prediction: PathPrediction) -> list[Check]:
    """Return the checks of a prediction, in the order in which they become reasons.

    With speed servos, wheels may slide or saturate while the others drive the rover: friction and
    torque limit the rover as a whole.
    """
    if prediction.policy == SERVO:
        friction, torque = (
            check_servo_friction(rover, prediction),
            check_servo_torque(prediction),
        )
    else:
        friction, torque = _check_friction(rover, prediction), _check_torque(rover, prediction)
    return [
        _check_suspension(rover, prediction),
        _check_tilt(rover, prediction),
        _check_tip_over(rover, prediction),
        check_servo_lift(rover, prediction)
        if prediction.policy == SERVO
        else check_wheel_lift(prediction),
        _check_sinkage(rover, prediction),
        friction,
        torque,
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
        no_wheel(rocker),
        describe,
        np.hstack([rocker, bogie]) if breaks else rocker,
        "suspension angle",
    )


def _check_tilt(rover: Rover, prediction: PathPrediction) -> Check:
    tilt, limit = tilt_of(prediction), np.degrees(rover.limits.tilt)
    extreme, sure = largest_and_sure(tilt)

    def describe(i: int) -> str:
        return f"tilt {compare(np.degrees(tilt[i]), limit, 1, ' deg')}"

    return Check(
        "tilt",
        extreme,
        not sure or bool(np.degrees(extreme) > limit + TOLERANCE),
        lambda: ~(np.degrees(tilt) <= limit + TOLERANCE),
        lambda: share_left(np.degrees(tilt), limit),
        no_wheel(tilt),
        describe,
        tilt,
        "tilt",
    )


def _check_tip_over(rover: Rover, prediction: PathPrediction) -> Check:
    ratio, limit = prediction.tip_over_ratio, rover.limits.tip_over_ratio

    def describe(i: int) -> str:
        return f"tip-over ratio {compare(ratio[i], limit, 2)}"

    extreme, sure = smallest_and_sure(ratio)
    return Check(
        "tip_over",
        extreme,
        not sure or extreme < limit - TOLERANCE,
        lambda: ~(ratio >= limit - TOLERANCE),
        lambda: -share_left(ratio, limit),
        no_wheel(ratio),
        describe,
        ratio,
        "tip-over ratio",
    )


def _check_sinkage(rover: Rover, prediction: PathPrediction) -> Check:
    limit = MODERATE_SINKAGE * 2.0 * rover.wheel.radius
    words = "wheel sinks deeper than the soil model holds: sinkage"
    return check_wheels("sinkage", prediction.sinkage, limit, words, 3, " m")


def _check_friction(rover: Rover, prediction: PathPrediction) -> Check:
    limit, margin = rover.limits.friction_utilisation, prediction.control_margin
    words = "wheel slips: friction utilisation"
    check = check_wheels(
        "friction", prediction.friction_utilisation, limit * (1.0 - margin), words
    )
    return _name_margin(check, limit, margin)


def _check_torque(rover: Rover, prediction: PathPrediction) -> Check:
    limit, margin = rover.limits.torque_saturation, prediction.control_margin
    words = "motor saturates: torque saturation"
    check = check_wheels("torque", prediction.torque_saturation, limit * (1.0 - margin), words)
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
    return check_wheels("wheel_drop", prediction.wheel_drop, limit, words, 3, " m")


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
        lambda: -share_left(clearance, limit),
        no_wheel(clearance),
        describe,
        clearance,
        "belly clearance",
    )
