# SPDX-License-Identifier: Apache-2.0
"""The answer to one request: the verdict at once, its report on demand."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import EQUAL
from rover_physics.traversability.classification import ClassifiedWaypoint
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.path_planner import PathSearch
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.path_report import report_path
from rover_planner.planning.verdict_report import (
    GroundReport,
    SuspensionReport,
    VerdictReport,
)
from rover_planner.planning.ways.way_search import WayAnswer


@dataclass(frozen=True, eq=False)
class Judgement:
    """A judged path, or a refusal before any path was judged."""

    code: str
    """Code of the reason why not, as in a verdict or refusal; empty if traversable."""
    reason: str
    """Reason why not, in words; empty if traversable."""
    candidate: Candidate | None = None
    """The judged path; None if the request was refused before."""
    classify: Callable[[], tuple[ClassifiedWaypoint, ...]] = tuple
    """Classifies the waypoints; may sweep the path once more."""
    suspension: SuspensionReport | None = None
    """Comparison with the measured suspension; None without measurements."""
    search: PathSearch | None = None
    """The search that found the path; None if the path was given."""
    way: WayAnswer | None = None
    """The search around obstacles; None if there was none."""
    find_ground: Callable[[], GroundReport] | None = None
    """Finds the share of never seen ground under the belly; None without a judged path."""
    judge_rest: Callable[[], "Judgement"] | None = None
    """Judges the waypoints beyond the first failure and returns the judgement with them; None if
    they are judged."""

    @property
    def traversable(self) -> bool:
        """Whether the rover may drive the path."""
        return self.candidate is not None and self.candidate.verdict.traversable

    @cached_property
    def classes(self) -> tuple[ClassifiedWaypoint, ...]:
        """The class of each waypoint; empty if no path was judged. Computed on first use."""
        return self.classify()

    def complete(self) -> "Judgement":
        """Return the judgement with all done that needs the model; later calls are quick.

        If there is no time for the waypoints beyond the first failure, or for classes, the
        judgement is without them.
        """
        whole = self
        try:
            whole = self._with_rest()
            _ = whole.changes() if whole._is_equal_and_traversable else whole.classes
            _ = whole.ground
        except QuestionStoppedError:
            return replace(whole, classify=tuple, judge_rest=None)
        return whole

    def _with_rest(self) -> "Judgement":
        """Return the judgement with the waypoints beyond the first failure."""
        if self.judge_rest is None:
            return self
        return replace(self.judge_rest(), code=self.code, reason=self.reason, way=self.way)

    @property
    def _is_equal_and_traversable(self) -> bool:
        """Whether all waypoints are passable with equal torques, which needs no other sweep."""
        candidate = self.candidate
        return candidate is not None and self.traversable and candidate.verdict.policy == EQUAL

    @cached_property
    def report(self) -> VerdictReport:
        """The full report of the request. Computed on first use, with the classes and the rest."""
        if self.judge_rest is not None:
            return self._with_rest().report
        if self.candidate is None:
            return VerdictReport(False, self.code, self.reason)
        report = report_path(self.candidate, self.classes, self.suspension, self.search)
        return replace(report, code=self.code, reason=self.reason, ground=self.ground)

    @cached_property
    def ground(self) -> GroundReport | None:
        """Never seen ground under the belly; None without a judged path. Computed on first use."""
        return None if self.find_ground is None else self.find_ground()

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


def refusal(code: str, reason: str) -> Judgement:
    """Return the refusal of a request without a judged path."""
    return Judgement(code, reason)
