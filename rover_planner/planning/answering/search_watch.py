# SPDX-License-Identifier: Apache-2.0
"""Watches a search for a path: reports its progress, and ends it when the map has changed."""

import time
from collections.abc import Callable
from typing import Any

from rover_planner.maps.known_map import KnownMap
from rover_planner.planning.search.lattice_search import SearchProgress

PERIOD = 0.2
"""Least time between two reports [s]."""


class NewerMapError(Exception):
    """The map has changed while a path was searched on it."""


class SearchWatch:
    """Watches the searches of one question.

    The question is to be answered again after a NewerMapError: what is known of unchanged ground
    is remembered. After `patience` a changed map no longer ends the search, so that maps that
    change all the time do not keep the question from its answer.
    """

    def __init__(
        self,
        newest_map: Callable[[], KnownMap | None],
        send_report: Callable[[dict[str, Any]], object],
        patience: float,
    ):
        """Watch the searches of a question.

        Args:
            newest_map: Returns the newest map.
            send_report: Takes a report, in the thread of the search: True if a path is `found`,
                its `cost` (infinite without one) and the `bound` from below on that of any path of
                the lattice (0 while it is not known) in metres of level ground, the number of
                `edges_judged`, and the `seconds` since the question's first search began.
            patience: Time from the first search on in which a changed map ends a search [s].
        """
        self._newest_map, self._send_report, self._patience = newest_map, send_report, patience
        self._began: float | None = None
        self._sent_at = 0.0

    def look(self, searched: KnownMap, progress: SearchProgress) -> None:
        """Report how far the search on a map is.

        Raises:
            NewerMapError: The map has changed.
        """
        now = time.monotonic()
        if self._began is None:
            self._began = now
        seconds = now - self._began
        if now - self._sent_at >= PERIOD:
            self._sent_at = now
            self._send_report(
                {
                    "found": progress.best is not None,
                    "cost": progress.cost,
                    "bound": progress.least_cost,
                    "edges_judged": progress.judged,
                    "seconds": seconds,
                }
            )
        newest = self._newest_map()
        has_changed = newest is not None and newest.fingerprint != searched.fingerprint
        if has_changed and seconds < self._patience:
            raise NewerMapError("the map has changed while a path was searched on it")
