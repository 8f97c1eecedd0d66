"""Limits of a rover on speed servos: friction and torque limit it as a whole, wheels may lift."""

import numpy as np

from rover_physics.forces.servo import MIN_SPEED_SHARE
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.servo_path import LOCKED, STALLED
from rover_physics.rover.model import Rover
from rover_physics.traversability.check import (
    TOLERANCE,
    Check,
    check_wheel_lift,
    check_wheels,
    compare,
    largest_of,
)

MAX_TURN_OFF = 0.1
"""Largest turn [rad] off its path that a rover with speed servos may make within its wheelbase: a
curvature error that would double the width of its track within about two lengths."""
MAX_SLIDE = 0.2
"""Largest way [wheelbases] that it may slide off its path within its wheelbase: a slip angle of 11
degrees."""


def check_servo_lift(rover: Rover, prediction: PathPrediction) -> Check:
    """Return the check that no wheel lifts higher than its radius."""
    check = check_wheel_lift(prediction)
    heights, limit = prediction.lift_height, rover.wheel.radius
    words = "wheel lifts off the ground:"
    too_high = check_wheels("wheel_lift", heights, limit, words, 2, " m")
    return too_high._replace(extreme=check.extreme, margins=check.margins, wheels=check.wheels)


def check_servo_friction(rover: Rover, prediction: PathPrediction) -> Check:
    """Return the check that friction suffices, the path is kept, and no wheel is wedged."""
    values = prediction.friction_utilisation
    loads = np.maximum(prediction.wheel_loads, 0.0)
    shear = np.hypot(prediction.tangential, prediction.lateral)
    most = (prediction.friction * loads).sum(axis=1)
    use = shear.sum(axis=1) / np.maximum(most, TOLERANCE)
    words = "no forward speed balances: the wheels slide"
    wedged = "a wheel is wedged between faces in front and behind"
    check = _check_drive("friction", prediction, values, use, words)
    most_turn, most_slide = MAX_TURN_OFF, MAX_SLIDE * _wheelbase(rover)
    turn, slide = prediction.drift.T
    off = (turn > most_turn) | (slide > most_slide)
    if not (check.breaks or off.any()):
        return check

    def describe(i: int) -> str:
        if turn[i] > most_turn:
            return f"rover turns off its path: {compare(turn[i], most_turn, 2, ' rad')}"
        if slide[i] > most_slide:
            return f"rover slides off its path: {compare(slide[i], most_slide, 2, ' m')}"
        return wedged if prediction.stalls[i] == LOCKED else words

    broken = np.asarray(check.broken() | off)
    return check._replace(
        breaks=True,
        broken=lambda: broken,
        margins=lambda: np.where(broken, np.nan, 1.0 - use),
        describe=describe,
    )


def check_servo_torque(prediction: PathPrediction) -> Check:
    """Return the check that the motors do not stall."""
    values = prediction.torque_saturation
    words = "no forward speed balances: the motors stall at their largest torque"
    return _check_drive("torque", prediction, values, values.mean(axis=1), words)


def _check_drive(
    code: str, prediction: PathPrediction, values: np.ndarray, use: np.ndarray, words: str
) -> Check:
    """Return the check of friction or torque of a rover with speed servos.

    Args:
        code: "friction" or "torque".
        prediction: The prediction.
        values: (n, 6) use of friction or torque by each wheel.
        use: (n,) use by the whole rover.
        words: The reason.
    """
    stalls = prediction.stalls == STALLED
    broken = ~(prediction.speed_share >= MIN_SPEED_SHARE)
    broken &= stalls if code == "torque" else ~stalls
    return Check(
        code,
        largest_of(values),
        bool(broken.any()),
        lambda: broken,
        lambda: np.where(broken, np.nan, 1.0 - use),
        lambda: np.argmax(values, axis=1),
        lambda i: words,
        prediction.speed_share,
        "speed of the rover",
    )


def _wheelbase(rover: Rover) -> float:
    wheels = rover.suspension.wheels
    return wheels["front"][0] - wheels["rear"][0]
