"""How passable each waypoint is: with equal torques, only with traction control, or not at all."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS
from rover_physics.names import EQUAL, OPTIMAL, TORQUE_POLICIES, WHEELS
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_path import judge_path
from rover_physics.traversability.limit_checks import check_limits
from rover_physics.traversability.verdict import Verdict, find_reasons

PASSABLE = "passable"
WITH_TRACTION_CONTROL = "passable with traction control"
IMPASSABLE = "impassable"
TRAVERSABILITY_CLASSES = (PASSABLE, WITH_TRACTION_CONTROL, IMPASSABLE)
"""The classes, from best to worst."""
WHEEL_CONSTRAINTS = ("wheel_lift", "friction", "torque")
"""The paper's three constraints, by their codes in a verdict."""


@dataclass(frozen=True)
class ClassifiedWaypoint:
    """How passable one waypoint is, with the way to it, and what decides that."""

    traversability_class: str
    """PASSABLE, WITH_TRACTION_CONTROL or IMPASSABLE."""
    policy: str
    """Torque policy that the rest is about: EQUAL where passable, else OPTIMAL."""
    constraint: str
    """Code of the limit that is broken; else of the tightest of WHEEL_CONSTRAINTS."""
    wheel: str
    """Name of the wheel it is about, empty where it is about none."""
    margin: float
    """Share of the limit that is left, negative where broken; NaN where there is no amount."""
    reason: str
    """Why the waypoint is impassable, or why equal torques do not do; empty where passable."""


def classify_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> tuple[ClassifiedWaypoint, ...]:
    """ClassifiedWaypoint each waypoint of a path by what both torque policies make of it.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        options: As for `sweep_path`; its policy is not looked at.
        sigmas: As for `judge_path`.

    Returns:
        A class per waypoint; a limit broken on the way to a waypoint counts there, and so does
        that the rover would be trapped.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    equal = replace(options, policy=EQUAL)
    judged = judge_path(rover, terrain, poses, equal, sigmas=sigmas)
    return classify_judged(rover, terrain, *judged, equal, sigmas=sigmas)


def classify_judged(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    verdict: Verdict,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> tuple[ClassifiedWaypoint, ...]:
    """ClassifiedWaypoint each waypoint of a path that `judge_path` has judged under one policy.

    The other policy is asked only where it matters: nothing that equal torques pass needs others.

    Args:
        rover: The rover.
        terrain: The ground.
        prediction: The path under either policy, from `judge_path`.
        verdict: What was said of it.
        options: The options it was judged with; their policy is not looked at.
        sigmas: The standard deviations of the map it was judged with.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    judged = {prediction.policy: (prediction, verdict)}
    for policy in TORQUE_POLICIES:
        if policy not in judged:
            asked = replace(options, policy=policy)
            judged[policy] = judge_path(rover, terrain, prediction.poses, asked, sigmas=sigmas)
        if judged[policy][1].traversable:
            break
    equal = _decide(rover, *judged[EQUAL])
    optimal = _decide(rover, *judged[OPTIMAL]) if OPTIMAL in judged else equal
    return tuple(_classify(one, other) for one, other in zip(equal, optimal, strict=True))


def deciding_waypoint(classes: Sequence[ClassifiedWaypoint]) -> int:
    """Return the index of the waypoint that the class of a whole path hangs on.

    Of the waypoints with the worst class it is the first where that is IMPASSABLE, else the one
    with the least margin.
    """
    worst = max(
        TRAVERSABILITY_CLASSES.index(waypoint.traversability_class) for waypoint in classes
    )
    among = [
        i
        for i, waypoint in enumerate(classes)
        if TRAVERSABILITY_CLASSES.index(waypoint.traversability_class) == worst
    ]
    if worst == TRAVERSABILITY_CLASSES.index(IMPASSABLE):
        return among[0]
    margins = np.array([classes[i].margin for i in among])
    return among[int(np.argmin(np.where(np.isnan(margins), np.inf, margins)))]


class _Decision(NamedTuple):
    """What decides about a waypoint under one policy; its reason is empty where passable."""

    constraint: str
    wheel: int
    margin: float
    reason: str


_NOTHING_ASKED = _Decision("", -1, float("nan"), "")
"""Where a wheel rolls off an edge none of WHEEL_CONSTRAINTS counts: see UNNEEDED_IN_A_FALL."""


def _classify(equal: _Decision, optimal: _Decision) -> ClassifiedWaypoint:
    """Return the class of a waypoint from what decides about it under either policy."""
    if not equal.reason:
        traversability_class, policy, decision, reason = PASSABLE, EQUAL, equal, ""
    elif not optimal.reason:
        traversability_class, policy, decision, reason = (
            WITH_TRACTION_CONTROL,
            OPTIMAL,
            optimal,
            equal.reason,
        )
    else:
        traversability_class, policy, decision, reason = (
            IMPASSABLE,
            OPTIMAL,
            optimal,
            optimal.reason,
        )
    wheel = WHEELS[decision.wheel] if decision.wheel >= 0 else ""
    return ClassifiedWaypoint(
        traversability_class, policy, decision.constraint, wheel, decision.margin, reason
    )


def _decide(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> list[_Decision]:
    """Return what decides about each waypoint, the way to it included."""
    decisions = list(_decide_rows(rover, prediction))
    _look_between(rover, prediction, decisions)
    for i, (code, reason) in enumerate(zip(verdict.codes, verdict.reasons, strict=True)):
        if code != (decisions[i].constraint if decisions[i].reason else ""):
            # trapped, or what else is about more than the waypoint itself
            decisions[i] = _Decision(code, -1, float("nan"), reason)
    return decisions


def _look_between(rover: Rover, prediction: PathPrediction, decisions: list[_Decision]) -> None:
    """Replace what decides about a waypoint where the way to it is worse."""
    between = prediction.between
    if between is None or not len(between.poses):
        return
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


def _decide_rows(rover: Rover, prediction: PathPrediction) -> Iterator[_Decision]:
    checks = check_limits(rover, prediction)
    wheels = {check.code: check.wheels() for check in checks}
    margins = {check.code: check.margins() for check in checks}
    codes, reasons = find_reasons(rover, prediction)
    tightest = np.argmin([margins[code] for code in WHEEL_CONSTRAINTS], axis=0)
    falls = np.asarray(prediction.falling.any(axis=1)).tolist()
    for i, which in enumerate(tightest.tolist()):
        code = codes[i] or WHEEL_CONSTRAINTS[which]
        if code not in margins:
            yield _Decision(code, -1, float("nan"), reasons[i])
        elif falls[i] and not codes[i]:
            yield _NOTHING_ASKED
        else:
            yield _Decision(code, int(wheels[code][i]), float(margins[code][i]), reasons[i])
