# SPDX-License-Identifier: Apache-2.0
"""The answer to one request: the verdict at once, its report on demand."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import EQUAL
from rover_physics.traversability.classification import ClassifiedWaypoint
from rover_planner.maps.unobserved_ground import UnobservedShare
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.path_query import Candidate, PathSearch
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.verdict_report import (
    SuspensionReport,
    VerdictReport,
    report_path,
    report_refusal,
)


@dataclass(frozen=True, eq=False)
class PathJudgement:
    """A judged path, or a refusal before any path was judged."""

    code: str
    """Code of the reason why not, as in a verdict or refusal; empty if traversable."""
    reason: str
    """Reason why not, in words; empty if traversable."""
    candidate: Candidate | None = None
    """The judged path; None if the request was refused before."""
    judge: PathJudge | None = None
    """The model that has judged it; None if the request was refused before."""
    suspension: SuspensionReport | None = None
    """Comparison with the measured suspension; None without measurements."""
    search: PathSearch | None = None
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
        if self.candidate is None or self.judge is None or self.is_brief:
            return ()
        return self.judge.classify(self.candidate)

    def complete(self) -> "PathJudgement":
        """Return the judgement with all done that needs the model; later calls are quick.

        If there is no time for the waypoints beyond the first failure, or for classes, the
        judgement is without them.
        """
        whole = self
        try:
            whole = self._with_rest()
            if not whole._is_equal_and_traversable:
                _ = whole.classes
            _ = whole.ground
        except QuestionStoppedError:
            return replace(whole, is_brief=True)
        return whole

    def _with_rest(self) -> "PathJudgement":
        """Return the judgement with the waypoints beyond the first failure."""
        candidate, judge = self.candidate, self.judge
        if candidate is None or judge is None or candidate.is_complete or self.is_brief:
            return self
        return replace(self, candidate=judge.check(candidate.poses))

    @property
    def _is_equal_and_traversable(self) -> bool:
        """True if all waypoints are passable with equal torques, which needs no other sweep."""
        candidate = self.candidate
        return candidate is not None and self.traversable and candidate.verdict.policy == EQUAL

    @cached_property
    def report(self) -> VerdictReport:
        """The full report of the request. Computed on first use, with the classes and the rest."""
        whole, why = self._with_rest(), (self.code, self.reason)
        if whole.candidate is None:
            return report_refusal(*why)
        details = whole.classes, whole.suspension, whole.ground, whole.search
        return report_path(whole.candidate, why, *details)

    @cached_property
    def ground(self) -> UnobservedShare | None:
        """Never seen ground under the belly; None without a judged path. Computed on first use."""
        if self.candidate is None or self.judge is None or self.judge.unobserved_check is None:
            return None
        return self.judge.unobserved_check.share(self.candidate)

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
