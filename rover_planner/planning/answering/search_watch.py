# SPDX-License-Identifier: Apache-2.0
"""Watches a search for a way: tells of its progress, and ends it when the map has changed."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from rover_planner.errors import PlanningError
from rover_planner.maps.known_map import KnownMap
from rover_planner.planning.lattice.search import Progress

PERIOD = 0.2
"""Least time between two reports [s]."""


class NewerMapError(PlanningError):
    """The map has changed while a way was searched on it."""


@dataclass(frozen=True)
class SearchReport:
    """How far a search is."""

    found: bool
    """Whether a way is known."""
    cost: float
    """Cost of the best one [m of level ground]; infinite without one."""
    bound: float
    """Bound from below on the cost of any way on the lattice [m]; 0 while it is not known."""
    edges_judged: int
    """Number of edges that the model has judged."""
    seconds: float
    """Time since the question's first search began [s]."""


class SearchWatch:
    """Watches the searches of one question.

    The question is to be answered again after a NewerMapError: what is known of unchanged ground
    is remembered. After `patience` a changed map no longer ends the search, so that maps that
    change all the time do not keep the question from its answer.
    """

    def __init__(
        self,
        newest_map: Callable[[], KnownMap | None],
        tell: Callable[[SearchReport], object],
        patience: float,
    ):
        """Watch the searches of a question.

        Args:
            newest_map: Returns the newest map.
            tell: Takes a report, in the thread of the search.
            patience: Time from the first search on in which a changed map ends a search [s].
        """
        self._newest_map, self._tell, self._patience = newest_map, tell, patience
        self._began: float | None = None
        self._told = 0.0

    def look(self, searched: KnownMap, progress: Progress) -> None:
        """Tell how far the search on a map is.

        Raises:
            NewerMapError: The map has changed.
        """
        now = time.monotonic()
        if self._began is None:
            self._began = now
        seconds = now - self._began
        if now - self._told >= PERIOD:
            self._told = now
            self._tell(
                SearchReport(
                    progress.best is not None,
                    progress.cost,
                    progress.bound,
                    progress.judged,
                    seconds,
                )
            )
        newest = self._newest_map()
        has_changed = newest is not None and newest.fingerprint != searched.fingerprint
        if has_changed and seconds < self._patience:
            raise NewerMapError("the map has changed while a way was searched on it")
