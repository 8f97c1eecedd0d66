"""The answer to one request: yes or no at once, and all there is to say about it on demand."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.traversability.classification import ClassifiedWaypoint
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.path_report import describe_classes, describe_path


@dataclass(frozen=True, eq=False)
class Judgement:
    """A judged path, or a refusal before any path was judged."""

    code: str
    """Why not, as one of the codes of a verdict; empty if traversable."""
    reason: str
    """Why not, in words; empty if traversable."""
    candidate: Candidate | None = None
    """The path that was judged; None where the request was refused before."""
    classify: Callable[[], tuple[ClassifiedWaypoint, ...]] = tuple
    """Classes the waypoints; may have to sweep the path once more."""
    notes: Callable[[], Mapping[str, Any]] = dict
    """Tells further entries of the verdict."""

    @property
    def traversable(self) -> bool:
        """Whether the rover may drive."""
        return self.candidate is not None and self.candidate.verdict.traversable

    @cached_property
    def classes(self) -> tuple[ClassifiedWaypoint, ...]:
        """How passable each waypoint is; empty where no path was judged."""
        return self.classify()

    @cached_property
    def verdict(self) -> dict[str, Any]:
        """What there is to say, of JSON's types or numpy's: `traversable`, `code`, `reason`..."""
        if self.candidate is None:
            said = {"code": self.code, "reason": self.reason, "first_failure": -1}
            return {"traversable": False, **said, **self.notes()}
        path, classes = describe_path(self.candidate), describe_classes(self.classes)
        return {**path, **classes, **self.notes()}

    def changes(self) -> NDArray[np.intp]:
        """Return the waypoints that have another class than the one before."""
        candidate = self.candidate
        if candidate is None or (self.traversable and candidate.verdict.policy == "equal"):
            return np.empty(0, np.intp)  # all are passable: no need to ask
        names = np.array([waypoint.traversability_class for waypoint in self.classes])
        return np.flatnonzero(names[1:] != names[:-1]) + 1

    def summary(self) -> str:
        """Say in a few words what the answer is."""
        if self.candidate is None or not self.traversable:
            return f"refused ({self.code}): {self.reason}"
        prediction = self.candidate.prediction
        return (
            f"traversable, {self.candidate.length:.2f} m, {prediction.time[-1]:.0f} s, "
            f"{prediction.energy[-1]:.1f} J"
        )


def refusal(code: str, reason: str) -> Judgement:
    """Refuse a request that no path could be judged for."""
    return Judgement(code, reason)
