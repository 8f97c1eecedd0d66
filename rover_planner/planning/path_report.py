"""What is said about a judged path: extents, failure and grades, as keys of a verdict."""

from collections.abc import Sequence
from typing import Any

from rover_physics.traversability.traversability_class import Grade, deciding_waypoint
from rover_planner.planning.path_query import Candidate

PER_WAYPOINT = {
    "grades": "grade",
    "grade_constraints": "constraint",
    "grade_wheels": "wheel",
    "grade_margins": "margin",
}
"""Keys with a value for each waypoint, and the field of a Grade that each holds."""


def describe_path(candidate: Candidate) -> dict[str, Any]:
    """Return verdict, extents and failure of a judged path."""
    prediction, failure = candidate.prediction, candidate.verdict.first_failure
    verdict = dict(candidate.verdict.to_dict())
    verdict["waypoints"] = len(prediction.poses)
    verdict["length"] = candidate.length
    verdict["time"] = float(prediction.time[-1])
    verdict["energy"] = float(prediction.energy[-1])
    if failure >= 0:
        verdict["failure_pose"] = prediction.poses[failure].tolist()
        verdict["failure_distance"] = candidate.reach * candidate.length
    return verdict


def describe_grades(grades: Sequence[Grade]) -> dict[str, Any]:
    """Return the grade of a path, with what decides it, and those of its waypoints."""
    waypoint = deciding_waypoint(grades)
    worst = grades[waypoint]
    summary = {
        "grade": worst.grade,
        "grade_waypoint": waypoint,
        "grade_constraint": worst.constraint,
        "grade_wheel": worst.wheel,
        "grade_margin": worst.margin,
        "grade_reason": worst.reason,
    }
    lists = {
        key: [getattr(grade, field) for grade in grades] for key, field in PER_WAYPOINT.items()
    }
    return summary | lists
