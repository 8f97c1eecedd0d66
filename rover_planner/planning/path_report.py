"""What is said about a judged path: extents, failure and classes, as keys of a verdict."""

from collections.abc import Sequence
from typing import Any

from rover_physics.traversability.classification import ClassifiedWaypoint, deciding_waypoint
from rover_planner.planning.path_query import Candidate

PER_WAYPOINT = {
    "traversability_classes": "traversability_class",
    "class_constraints": "constraint",
    "class_wheels": "wheel",
    "class_margins": "margin",
}
"""Keys with a value for each waypoint, and the field of a ClassifiedWaypoint that each holds."""


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


def describe_classes(classes: Sequence[ClassifiedWaypoint]) -> dict[str, Any]:
    """Return the class of a path, with what decides it, and those of its waypoints."""
    waypoint = deciding_waypoint(classes)
    worst = classes[waypoint]
    summary = {
        "traversability_class": worst.traversability_class,
        "class_waypoint": waypoint,
        "class_constraint": worst.constraint,
        "class_wheel": worst.wheel,
        "class_margin": worst.margin,
        "class_reason": worst.reason,
    }
    lists = {
        key: [getattr(waypoint, field) for waypoint in classes]
        for key, field in PER_WAYPOINT.items()
    }
    return summary | lists
