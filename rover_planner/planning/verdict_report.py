# SPDX-License-Identifier: Apache-2.0
"""The report of a request: the verdict with all its details, as flat JSON."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from rover_physics.numerics.plain_values import to_plain
from rover_physics.traversability.classification import ClassifiedWaypoint, deciding_waypoint
from rover_physics.traversability.verdict import BOUNDS, EXTREMES
from rover_planner.maps.unobserved_ground import UnobservedShare
from rover_planner.planning.path_query import Candidate, PathSearch

REPORTED = (*EXTREMES, "risk", "map_sigmas", *BOUNDS, "failure_chance")
"""Fields of a verdict that a report has."""


TOLD, LEARNED = "told", "learned"
"""Source of the friction of a question."""


@dataclass(frozen=True)
class SuspensionReport:
    """Comparison of the measured suspension angles with those predicted where the rover stands."""

    suspension_mismatch: Mapping[str, float]
    """Measured minus predicted angle [rad] by joint, for the joints that were measured."""
    suspension_agrees: bool
    """True if all of them are within the tolerance."""


@dataclass(frozen=True)
class IdentityReport:
    """Identity of an answer: its question, path and map."""

    request: int
    """Number of the question; it rises strictly while the server runs, over all its services."""
    service: str
    """Name of the service that was called, such as can_traverse."""
    server: str
    """Random text that a server keeps while it runs; another one after a restart."""
    question_hash: str
    """`msg_adapters.identity.plan_request_hash` of a plan request, or `path_hash` of the path that
    was checked."""
    path_hash: str
    """`msg_adapters.identity.path_hash` of the path that was checked or of the plan that was
    returned; empty without path."""
    path_stamp: str
    """Stamp of that path, "seconds.nanoseconds"; empty without path."""
    map_hash: str
    """Fingerprint of the map; empty without map."""
    map_stamp: str
    """Stamp of the map's header, "seconds.nanoseconds"; empty if it has none."""
    map_age: float
    """Age of the map when the question arrived [s]; NaN without map."""
    ground: str = TOLD
    """LEARNED if the question assumed what was learned of the friction, else TOLD."""
    ground_friction: float = math.nan
    """Learned friction, assumed or only suggested; NaN if there is none."""
    ground_friction_std: float = math.nan
    """Standard deviation of it."""
    ground_since: str = ""
    """Time of that estimate, "seconds.nanoseconds"."""
    ground_classes: Mapping[str, float] = field(default_factory=dict)
    """Friction that was assumed on each class of ground of the map, where it has none of its own;
    empty unless a learned one is assumed and the map has classes."""


@dataclass(frozen=True)
class VerdictReport:
    """The answer to a request with all its details; docs/traverse_server.md explains its keys."""

    entries: Mapping[str, Any]
    """Verdict, code and reason; the judged path, if there is one, and the search for it."""
    per_waypoint: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    """Verdict and class of each waypoint. If there was no time for the waypoints beyond the first
    failure, the lists are without them."""
    identity: IdentityReport | None = None
    """Its question, path and map; None if it was not asked for over ROS."""

    @property
    def traversable(self) -> bool:
        """True if the rover may drive the path."""
        return bool(self.entries["traversable"])

    @property
    def reason(self) -> str:
        """Reason why not, in words; empty if traversable."""
        return str(self.entries["reason"])

    @property
    def has_warning(self) -> bool:
        """True if the measured suspension disagrees with the prediction."""
        return not self.entries.get("suspension_agrees", True)

    def to_dict(self) -> dict[str, Any]:
        """Return all entries in JSON types: one level, None for NaN and infinity."""
        return self.summary() | to_plain(dict(self.per_waypoint))

    def summary(self) -> dict[str, Any]:
        """Return the entries of `to_dict` without those that have a value per waypoint."""
        about = {} if self.identity is None else asdict(self.identity)
        plain: dict[str, Any] = to_plain({**self.entries, **about})
        return plain


def report_refusal(code: str, reason: str) -> VerdictReport:
    """Return the report of a request that was refused before a path was judged."""
    return VerdictReport(
        {"traversable": False, "code": code, "reason": reason, "first_failure": -1}
    )


def report_path(
    candidate: Candidate,
    why: tuple[str, str],
    classes: Sequence[ClassifiedWaypoint],
    suspension: SuspensionReport | None = None,
    ground: UnobservedShare | None = None,
    search: PathSearch | None = None,
) -> VerdictReport:
    """Return the full report of a judged path.

    Args:
        candidate: The path.
        why: Code and reason of the answer; both are empty if the path is traversable.
        classes: The classes of its waypoints; empty if there was no time to find them.
        suspension: The comparison with the measured suspension; None without measurements.
        ground: Never seen ground under the belly; None if it is not known.
        search: The search that found the path; None if the path was given.
    """
    verdict = candidate.verdict
    entries = {"traversable": verdict.traversable, "code": why[0], "reason": why[1]}
    entries |= _report_drive(candidate)
    if classes:
        entries |= _report_class(classes)
    if suspension is not None:
        entries |= asdict(suspension)
    if ground is not None:
        entries["blind_share"] = ground.unobserved_share
        entries["footprint_share"] = ground.footprint_share
    if search is not None:
        entries |= _report_search(search)
    return VerdictReport(
        entries,
        {
            "codes": verdict.codes,
            "reasons": verdict.reasons,
            "failure_chance_at": verdict.failure_chance_at or [math.nan] * len(verdict.codes),
            "traversability_classes": [one.traversability_class for one in classes],
            "class_constraints": [one.constraint for one in classes],
            "class_wheels": [one.wheel for one in classes],
            "class_margins": [one.margin for one in classes],
        },
    )


def _report_drive(candidate: Candidate) -> dict[str, Any]:
    """Return the first failure of a path, its extremes, length, time [s] and energy [J]."""
    verdict, prediction = candidate.verdict, candidate.prediction
    failure = verdict.first_failure
    entries: dict[str, Any] = {"first_failure": failure}
    if failure >= 0:
        entries["failure_pose"] = prediction.poses[failure]
        entries["failure_distance"] = candidate.passable_share * candidate.length
    return {
        **entries,
        "policy": verdict.policy,
        **{name: getattr(verdict, name) for name in REPORTED},
        "waypoints": len(candidate.poses),
        "predicted_waypoints": len(prediction.poses),
        "length": candidate.length,
        "time": prediction.time[-1] if candidate.is_complete else math.nan,
        "energy": prediction.energy[-1] if candidate.is_complete else math.nan,
    }


def _report_class(classes: Sequence[ClassifiedWaypoint]) -> dict[str, Any]:
    """Return the class of a path and the waypoint that decides it."""
    waypoint = deciding_waypoint(classes)
    worst = classes[waypoint]
    return {
        "traversability_class": worst.traversability_class,
        "class_waypoint": waypoint,
        "class_constraint": worst.constraint,
        "class_wheel": worst.wheel,
        "class_margin": worst.margin,
        "class_reason": worst.reason,
    }


def _report_search(search: PathSearch) -> dict[str, Any]:
    """Return what was tried to find a path to a goal."""
    candidates = search.answer.candidates
    return {
        "goal": search.goal,
        "goal_offset": search.goal_offset,
        "alternative_goals_tried": search.alternatives_tried,
        "candidates": len(candidates),
        "traversable_candidates": sum(one.verdict.traversable for one in candidates),
        "chosen_candidate": search.answer.number,
        "explanation": search.answer.explain(),
    }
