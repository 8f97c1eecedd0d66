# SPDX-License-Identifier: Apache-2.0
"""Traversability classes: what drive a rover needs to pass, or that it cannot."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import is_uncertain
from rover_physics.limits.table import WHEEL_CONSTRAINTS
from rover_physics.names import CONTROL_POLICIES, EQUAL, TORQUE_POLICIES, WHEELS
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import Uses, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import SIGMAS
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path, judge_poses
from rover_physics.traversability.verdict import Verdict, explain_rows

PASSABLE = "passable"
WITH_SPEED_SERVOS = "passable with speed servos"
WITH_TRACTION_CONTROL = "passable with traction control"
IMPASSABLE = "impassable"
OF_POLICY = dict(
    zip(TORQUE_POLICIES, (PASSABLE, WITH_SPEED_SERVOS, WITH_TRACTION_CONTROL), strict=True)
)
"""The class of what passes first under a policy."""
TRAVERSABILITY_CLASSES = (*OF_POLICY.values(), IMPASSABLE)
"""The classes, from best to worst."""


@dataclass(frozen=True)
class ClassifiedWaypoint:
    """Class of one waypoint, including the step to it, and the constraint that decides it."""

    traversability_class: str
    """One of TRAVERSABILITY_CLASSES."""
    policy: str
    """Torque policy of the fields below: EQUAL if passable, SERVO if passable with speed servos,
    else OPTIMAL."""
    constraint: str
    """Code of the broken limit; if none is broken, of the tightest of WHEEL_CONSTRAINTS."""
    wheel: str
    """Name of the wheel concerned, empty if none."""
    margin: float
    """Share of the limit that is left, negative if it is broken; NaN if it has no amount."""
    reason: str
    """Why the waypoint is impassable, or why the simpler drives before its class are not enough;
    empty if passable."""


def classify_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> tuple[ClassifiedWaypoint, ...]:
    """Classify each waypoint of a path from its verdicts under all torque policies.

    On maps with uncertain heights no waypoint is passable with speed servos, as their policy has
    no bounds. A waypoint that needs traction control leaves the control margin of
    the options.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        options: As for `judge_path`; its policy is ignored.
        sigmas: As for `judge_path`.

    Returns:
        A class per waypoint. A limit broken on the way to a waypoint counts at that waypoint, as
        does entrapment. Where waypoints need different drives, none may pass the whole path.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    equal = replace(options, policy=EQUAL)
    judged = judge_path(rover, terrain, poses, equal, sigmas=sigmas)
    return classify_judged(rover, terrain, *judged, equal, sigmas=sigmas)


@quiet
def classify_judged(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    verdict: Verdict,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    curvature: ArrayLike | None = None,
) -> tuple[ClassifiedWaypoint, ...]:
    """Classify each waypoint of a path that `judge_path` has judged under one policy.

    The path is judged under the other policies only if needed: a path that is traversable with
    equal torques needs no others, nor does one with speed servos need optimal torques.

    Args:
        rover: The rover.
        terrain: The ground.
        prediction: The path under any policy, from `judge_path`.
        verdict: The verdict on it, from `judge_path`.
        options: The options it was judged with; their policy is ignored.
        sigmas: The standard deviations of the map it was judged with.
        curvature: (n,) as for `judge_poses`, if this has judged single poses.

    Returns:
        A class per waypoint, as `classify_path`.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    judged = {prediction.policy: (prediction, verdict)}
    decided: list[list[ClassifiedWaypoint]] = []
    policies = CONTROL_POLICIES if is_uncertain(terrain, sigmas) else TORQUE_POLICIES
    for policy in policies:
        if policy not in judged:
            asked, poses = replace(options, policy=policy), prediction.poses
            if curvature is None:
                judged[policy] = judge_path(rover, terrain, poses, asked, sigmas=sigmas)
            else:
                judged[policy] = judge_poses(
                    rover, terrain, poses, curvature, asked, sigmas=sigmas
                )
        decided.append(_decide(rover, *judged[policy]))
        if judged[policy][1].traversable:
            break
    return tuple(map(_choose, zip(*decided, strict=True)))


def deciding_waypoint(classes: Sequence[ClassifiedWaypoint]) -> int:
    """Return the index of the waypoint that decides the class of the whole path.

    If the worst class is IMPASSABLE, it is the first such waypoint. Otherwise it is the waypoint
    of the worst class with the smallest margin.
    """
    ranks = np.array([TRAVERSABILITY_CLASSES.index(one.traversability_class) for one in classes])
    among = np.flatnonzero(ranks == ranks.max()).tolist()
    if classes[among[0]].traversability_class == IMPASSABLE:
        return among[0]
    margins = np.array([classes[i].margin for i in among])
    return among[int(np.argmin(np.where(np.isnan(margins), np.inf, margins)))]


def _choose(decisions: Sequence[ClassifiedWaypoint]) -> ClassifiedWaypoint:
    """Return the class of a waypoint from its decisions by policy, in TORQUE_POLICIES order."""
    why_not = ""
    for decision in decisions:
        if not decision.reason:
            return replace(decision, reason=why_not)
        why_not = decision.reason
    return decision


def _decide(
    rover: Rover, prediction: PathPrediction, verdict: Verdict
) -> list[ClassifiedWaypoint]:
    """Return the decision of each waypoint under one policy; its reason is empty if it passes.

    Where the step to it is worse than the waypoint, that counts.
    """
    decisions = list(_decide_rows(rover, prediction))
    between = prediction.between
    if between is not None and len(between.poses):
        at_crossings = zip(between.waypoint.tolist(), _decide_rows(rover, between), strict=True)
        for i, other in at_crossings:
            own = decisions[i]
            if own.reason:
                continue
            if other.reason:
                decisions[i] = replace(other, reason=f"on the way here: {other.reason}")
            elif other.margin < own.margin or np.isnan(own.margin):
                decisions[i] = other
    for i, (code, reason) in enumerate(zip(verdict.codes, verdict.reasons, strict=True)):
        if code != (decisions[i].constraint if decisions[i].reason else ""):
            # The verdict knows more than the waypoint alone, such as entrapment or bounds.
            decisions[i] = _decision(prediction.policy, code, reason)
    return decisions


def _decide_rows(rover: Rover, prediction: PathPrediction) -> Iterator[ClassifiedWaypoint]:
    """Yield the decision of each row: its first broken limit, else its tightest constraint.

    While a wheel rolls off an edge no wheel constraint counts.
    """
    uses = find_uses(limits_of(rover, prediction.policy), prediction.results)
    reasons, first = explain_rows(rover, prediction, uses), uses.find_first()
    is_constraint = np.array([row.code in WHEEL_CONSTRAINTS for row in uses.limits.rows])
    asked = np.where(is_constraint & ~np.isnan(uses.use), uses.use, -np.inf)
    for i in range(len(prediction.poses)):
        check_interruption()
        code, reason = reasons.get(i, ("", ""))
        k = int(first[i] if reason else asked[i].argmax())
        if not prediction.settled[i] or not (reason or asked[i, k] > -np.inf):
            yield _decision(prediction.policy, code, reason)
            continue
        limit, use = uses.limits.rows[k], float(uses.use[i, k])
        margin = 1.0 - use if limit.has_number or use <= 1.0 else np.nan
        wheel = find_wheel(prediction, uses, i, k)
        yield _decision(prediction.policy, code or limit.code, reason, wheel, margin)


def _decision(
    policy: str, code: str, reason: str, wheel: int = -1, margin: float = np.nan
) -> ClassifiedWaypoint:
    """Return what decides a waypoint under one policy."""
    name = WHEELS[wheel] if wheel >= 0 else ""
    found = IMPASSABLE if reason else OF_POLICY[policy]
    return ClassifiedWaypoint(found, policy, code, name, margin, reason)


def find_wheel(prediction: PathPrediction, uses: Uses, row: int, k: int) -> int:
    """Return the index of the wheel that decides limit k at a row, -1 if none does."""
    limit = uses.limits.rows[k]
    if limit.wheel_of:
        return int(np.argmax(getattr(prediction, limit.wheel_of)[row]))
    is_of_wheels = uses.limits.records["count"][k] == len(WHEELS) and not limit.elements
    return int(uses.element[row, k]) if is_of_wheels else -1
