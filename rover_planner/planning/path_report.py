# SPDX-License-Identifier: Apache-2.0
"""Makes the report of a judged path: extremes, failure, classes and the search for it."""

import math
from collections.abc import Sequence

from rover_physics.traversability.classification import ClassifiedWaypoint, deciding_waypoint
from rover_physics.traversability.verdict import BOUNDS, EXTREMES
from rover_planner.planning.path_planner import PathSearch
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.verdict_report import (
    ClassReport,
    FailureReport,
    PathReport,
    SearchReport,
    SuspensionReport,
    VerdictReport,
    WaypointLists,
)

REPORTED = (*EXTREMES, "risk", "map_sigmas", *BOUNDS)
"""Fields of a verdict that a report has."""


def report_path(
    candidate: Candidate,
    classes: Sequence[ClassifiedWaypoint],
    suspension: SuspensionReport | None = None,
    search: PathSearch | None = None,
) -> VerdictReport:
    """Return the full report of a judged path.

    Args:
        candidate: The path.
        classes: The classes of its waypoints; empty if there was no time to find them.
        suspension: The comparison with the measured suspension; None without measurements.
        search: The search that found the path; None if the path was given.
    """
    verdict = candidate.verdict
    return VerdictReport(
        traversable=verdict.traversable,
        code=verdict.code,
        reason=verdict.reason,
        first_failure=verdict.first_failure,
        failure=_report_failure(candidate),
        path=_report_extremes(candidate),
        classes=_report_class(classes) if classes else None,
        suspension=suspension,
        search=None if search is None else _report_search(search),
        waypoint_lists=_list_waypoints(candidate, classes),
    )


def _report_failure(candidate: Candidate) -> FailureReport | None:
    """Return the first failure of a path, None if there is none."""
    failure = candidate.verdict.first_failure
    if failure < 0:
        return None
    pose = tuple(candidate.prediction.poses[failure].tolist())
    return FailureReport(pose, candidate.reach * candidate.length)


def _report_extremes(candidate: Candidate) -> PathReport:
    """Return length, time, energy and extremes of a judged path."""
    verdict, prediction = candidate.verdict, candidate.prediction
    return PathReport(
        policy=verdict.policy,
        extremes={name: getattr(verdict, name) for name in REPORTED},
        waypoints=len(candidate.poses),
        length=candidate.length,
        time=float(prediction.time[-1]) if candidate.is_complete else math.nan,
        energy=float(prediction.energy[-1]) if candidate.is_complete else math.nan,
    )


def _report_class(classes: Sequence[ClassifiedWaypoint]) -> ClassReport:
    """Return the class of a path and the waypoint that decides it."""
    waypoint = deciding_waypoint(classes)
    worst = classes[waypoint]
    return ClassReport(
        traversability_class=worst.traversability_class,
        class_waypoint=waypoint,
        class_constraint=worst.constraint,
        class_wheel=worst.wheel,
        class_margin=worst.margin,
        class_reason=worst.reason,
    )


def _list_waypoints(candidate: Candidate, classes: Sequence[ClassifiedWaypoint]) -> WaypointLists:
    """Return verdict and class of each waypoint."""
    return WaypointLists(
        codes=candidate.verdict.codes,
        reasons=candidate.verdict.reasons,
        traversability_classes=tuple(waypoint.traversability_class for waypoint in classes),
        class_constraints=tuple(waypoint.constraint for waypoint in classes),
        class_wheels=tuple(waypoint.wheel for waypoint in classes),
        class_margins=tuple(waypoint.margin for waypoint in classes),
    )


def _report_search(search: PathSearch) -> SearchReport:
    """Return the report of the search for a path to a goal."""
    candidates = search.answer.candidates
    return SearchReport(
        goal=tuple(search.goal.tolist()),
        goal_offset=search.goal_offset,
        alternative_goals_tried=search.alternatives_tried,
        candidates=len(candidates),
        traversable_candidates=sum(candidate.verdict.traversable for candidate in candidates),
        chosen_candidate=search.answer.number,
        explanation=search.answer.explain(),
    )
