# SPDX-License-Identifier: Apache-2.0
"""The answer to one request: the verdict at once, its report on demand."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import EQUAL
from rover_physics.traversability.classification import ClassifiedWaypoint, deciding_waypoint
from rover_physics.traversability.verdict import BOUND_EXTREMES, EXTREMES
from rover_planner.maps.unobserved_ground import UnobservedShare
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.path_query import Candidate, PathAnswer
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import Site

REPORTED = (*EXTREMES, "risk", "map_sigmas", *BOUND_EXTREMES, "failure_chance")
"""Fields of a verdict that a report has."""
PER_WAYPOINT = (
    "codes",
    "reasons",
    "failure_chance_at",
    "traversability_classes",
    "class_constraints",
    "class_wheels",
    "class_margins",
)
"""Keys of a report whose values are lists with a value for each waypoint. If there was no time for
the waypoints beyond the first failure, they are without them."""
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


@dataclass(frozen=True, eq=False)
class PathJudgement:
    """A judged path, or a refusal before any path was judged."""

    code: str
    """Code of the reason why not, as in a verdict or refusal; empty if traversable."""
    reason: str
    """Reason why not, in words; empty if traversable."""
    candidate: Candidate | None = None
    """The judged path; None if the request was refused before."""
    site: Site | None = None
    """For what it was judged; None if the request was refused before."""
    suspension: SuspensionReport | None = None
    """Comparison with the measured suspension; None without measurements."""
    search: PathAnswer | None = None
    """The search that found the path; None if the path was given."""
    around: SearchResult | None = None
    """The search around obstacles; None if there was none."""
    is_brief: bool = False
    """True without classes and waypoints beyond the first failure: there was no time for them, or
    they lie off the map."""

    @property
    def traversable(self) -> bool:
        """True if the rover may drive the path."""
        return self.candidate is not None and self.candidate.verdict.traversable

    @cached_property
    def classes(self) -> tuple[ClassifiedWaypoint, ...]:
        """The class of each waypoint; empty if no path was judged. Computed on first use."""
        if self.candidate is None or self.site is None or self.is_brief:
            return ()
        return PathJudge(self.site).classify(self.candidate)

    def complete(self) -> "PathJudgement":
        """Return the judgement with all done that needs the model; later calls are quick.

        If there is no time for the waypoints beyond the first failure, or for classes, the
        judgement is without them.
        """
        whole, candidate, site = self, self.candidate, self.site
        try:
            if candidate and site and not (candidate.is_complete or self.is_brief):
                whole = replace(self, candidate=PathJudge(site).check(candidate.poses))
            if not whole._is_equal_and_traversable:
                _ = whole.classes
            _ = whole.ground
        except QuestionStoppedError:
            return replace(whole, is_brief=True)
        return whole

    @property
    def _is_equal_and_traversable(self) -> bool:
        """True if all waypoints are passable with equal torques, which needs no other sweep."""
        candidate = self.candidate
        return candidate is not None and self.traversable and candidate.verdict.policy == EQUAL

    @cached_property
    def report(self) -> dict[str, Any]:
        """The full report of the request; docs/traverse_server.md explains its keys.

        Computed on first use, with the classes and the rest.
        """
        whole = self.complete()
        entries: dict[str, Any] = {
            "traversable": self.traversable,
            "code": self.code,
            "reason": self.reason,
        }
        candidate, classes, ground = whole.candidate, whole.classes, whole.ground
        if candidate is None:
            return {**entries, "first_failure": -1}
        entries |= _report_drive(candidate)
        if classes:
            entries |= _report_class(classes)
        if self.suspension is not None:
            entries |= asdict(self.suspension)
        if ground is not None:
            entries["blind_share"] = ground.unobserved_share
            entries["footprint_share"] = ground.footprint_share
        if self.search is not None:
            entries |= _report_search(self.search)
        verdict = candidate.verdict
        lists = (
            verdict.codes,
            verdict.reasons,
            verdict.failure_chance_at or [math.nan] * len(verdict.codes),
            [one.traversability_class for one in classes],
            [one.constraint for one in classes],
            [one.wheel for one in classes],
            [one.margin for one in classes],
        )
        return entries | dict(zip(PER_WAYPOINT, lists, strict=True))

    @cached_property
    def ground(self) -> UnobservedShare | None:
        """Never seen ground under the belly; None without a judged path. Computed on first use."""
        candidate, site = self.candidate, self.site
        if candidate is None or site is None or site.seen is None:
            return None
        return site.seen.share(site.rover, candidate.poses)

    def changes(self) -> NDArray[np.intp]:
        """Return the indices (m,) of waypoints whose class differs from that of the one before."""
        if self.candidate is None or self._is_equal_and_traversable:
            return np.empty(0, np.intp)  # all waypoints have the same class
        names = np.array([waypoint.traversability_class for waypoint in self.classes])
        return np.flatnonzero(names[1:] != names[:-1]) + 1

    def summary(self) -> str:
        """Return the answer in a few words."""
        if self.candidate is None or not self.traversable:
            return f"refused ({self.code}): {self.reason}"
        prediction = self.candidate.prediction
        return (
            f"traversable, {self.candidate.length:.2f} m, {prediction.time[-1]:.0f} s, "
            f"{prediction.energy[-1]:.1f} J"
        )


def refusal(code: str, reason: str) -> PathJudgement:
    """Return the refusal of a request without a judged path."""
    return PathJudgement(code, reason)


def refuse_for(error: str) -> PathJudgement:
    """Return the refusal for an error of this program, told in one line."""
    return refusal("internal_error", f"internal error: {error}")


def _report_drive(candidate: Candidate) -> dict[str, Any]:
    """Return the first failure of a path, its extremes, length, time [s] and energy [J]."""
    verdict, prediction = candidate.verdict, candidate.prediction
    failure = verdict.first_failure
    entries: dict[str, Any] = {"first_failure": failure}
    if failure >= 0:
        entries["failure_pose"] = prediction.poses[failure]
        entries["failure_distance"] = candidate.passable_length
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


def _report_search(search: PathAnswer) -> dict[str, Any]:
    """Return what was tried to find a path to a goal."""
    candidates = search.candidates
    return {
        "goal": search.goal,
        "goal_offset": search.goal_offset,
        "alternative_goals_tried": search.alternatives_tried,
        "candidates": len(candidates),
        "traversable_candidates": sum(one.verdict.traversable for one in candidates),
        "chosen_candidate": search.number,
        "explanation": search.explain(),
    }
