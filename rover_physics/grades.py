"""How passable each waypoint is: with equal torques, only with traction control, or not at all."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.limits import UNNEEDED_IN_A_FALL, find_reasons
from rover_physics.names import WHEELS
from rover_physics.prediction import PathPrediction
from rover_physics.reasons import Check, check_limits
from rover_physics.rover import Rover
from rover_physics.sweep import sweep_path
from rover_physics.terrain import Terrain

PASSABLE = "passable"
WITH_TRACTION_CONTROL = "passable with traction control"
IMPASSABLE = "impassable"
WHEEL_CONSTRAINTS = ("wheel_lift", "friction", "torque")
"""The paper's three constraints, by their codes in a verdict."""


@dataclass(frozen=True)
class Grade:
    """How passable one waypoint is, with the way to it, and what decides that."""

    grade: str
    """PASSABLE, WITH_TRACTION_CONTROL or IMPASSABLE."""
    policy: str
    """Torque policy that the rest is about: "equal" where passable, else "optimal"."""
    constraint: str
    """Code of the limit that is broken; else of the tightest of WHEEL_CONSTRAINTS."""
    wheel: str
    """Name of the wheel it is about, empty where it is about none."""
    margin: float
    """Share of the limit that is left, negative where broken; NaN where there is no amount."""
    reason: str
    """Why the waypoint is impassable, or why equal torques do not do; empty where passable."""


def grade_path(
    rover: Rover, terrain: Terrain, poses: ArrayLike, **arguments: Any
) -> tuple[Grade, ...]:
    """Grade each waypoint of a path by what both torque policies make of it.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        arguments: Further arguments of `sweep_path`, except `policy`.

    Returns:
        A grade per waypoint; a limit broken on the way to a waypoint counts there.

    Raises:
        PoseError, ModelError, SoilError: As `sweep_path`.
    """
    equal = sweep_path(rover, terrain, poses, policy="equal", **arguments)
    optimal = sweep_path(rover, terrain, poses, policy="optimal", **arguments)
    return grade_predictions(rover, equal, optimal)


def grade_predictions(
    rover: Rover, equal: PathPrediction, optimal: PathPrediction
) -> tuple[Grade, ...]:
    """Grade each waypoint from the predictions of the same path under both policies."""
    grades = []
    for one, other in zip(_decide(rover, equal), _decide(rover, optimal), strict=True):
        if not one.reason:
            grades.append(_grade(PASSABLE, "equal", one, ""))
        elif not other.reason:
            grades.append(_grade(WITH_TRACTION_CONTROL, "optimal", other, one.reason))
        else:
            grades.append(_grade(IMPASSABLE, "optimal", other, other.reason))
    return tuple(grades)


@dataclass(frozen=True)
class _Decision:
    """What decides about a waypoint under one policy; its reason is empty where passable."""

    constraint: str
    wheel: int
    margin: float
    reason: str


def _grade(grade: str, policy: str, decision: _Decision, reason: str) -> Grade:
    wheel = WHEELS[decision.wheel] if decision.wheel >= 0 else ""
    return Grade(grade, policy, decision.constraint, wheel, decision.margin, reason)


def _decide(rover: Rover, prediction: PathPrediction) -> list[_Decision]:
    """Return what decides about each waypoint, the way to it included."""
    decisions = list(_decide_rows(rover, prediction))
    between = prediction.between
    if between is None or not len(between.poses):
        return decisions
    on_the_way = zip(between.waypoint.tolist(), _decide_rows(rover, between), strict=True)
    for i, other in on_the_way:
        own = decisions[i]
        if own.reason:
            continue
        if other.reason:
            reason = f"on the way here: {other.reason}"
            decisions[i] = _Decision(other.constraint, other.wheel, other.margin, reason)
        elif other.margin < own.margin or np.isnan(own.margin):
            decisions[i] = other
    return decisions


def _decide_rows(rover: Rover, prediction: PathPrediction) -> Iterator[_Decision]:
    checks = {check.code: check for check in check_limits(rover, prediction)}
    codes, reasons = find_reasons(rover, prediction)
    falls = np.asarray(prediction.falling.any(axis=1))
    for i, (code, reason) in enumerate(zip(codes, reasons, strict=True)):
        if code:
            wheel, margin = _amount(checks.get(code), i)
            yield _Decision(code, wheel, margin, reason)
            continue
        asked = [c for c in WHEEL_CONSTRAINTS if not (falls[i] and c in UNNEEDED_IN_A_FALL)]
        if not asked:
            yield _Decision("", -1, float("nan"), "")
            continue
        tightest = min(asked, key=lambda c: checks[c].margin[i])
        yield _Decision(tightest, *_amount(checks[tightest], i), "")


def _amount(check: Check | None, i: int) -> tuple[int, float]:
    if check is None:
        return -1, float("nan")
    return int(check.wheel[i]), float(check.margin[i])
