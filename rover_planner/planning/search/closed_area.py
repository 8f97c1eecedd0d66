# SPDX-License-Identifier: Apache-2.0
"""The closed area around start or goal because of which there is no path, and what closes it."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_planner.planning.search.graph import spread
from rover_planner.planning.search.lattice_search import LatticeSearch
from rover_planner.planning.search.nodes import HEADINGS

_WORDS = {
    "off_map": "the edge of the map",
    "unknown_ground": "unknown ground",
    "wheel_drop": "drops",
    "wheel_lift": "lifting wheels",
    "tip_over": "tip-over",
    "not_settled": "ground that the wheels do not fit",
}
"""Words for codes that do not speak for themselves."""


@dataclass(frozen=True, eq=False)
class ClosedArea:
    """The places that the start, or the goal, is connected with."""

    around_goal: bool
    """True if it lies around the goal; else around the start."""
    places: NDArray[np.bool_]
    """(rows, columns) True for its places, row 0 at the smallest y."""
    area: float
    """Its area [m2]."""
    causes: dict[str, float]
    """Shares of the codes among the edges that would lead across its border, the largest first."""

    def describe(self) -> str:
        """Return one sentence for people."""
        whose = "from which the goal can be reached" if self.around_goal else "reachable"
        shares = ", ".join(
            f"{_WORDS.get(code, code.replace('_', ' '))} {round(100 * share)} %"
            for code, share in self.causes.items()
        )
        return f"{self.area:.1f} m2 {whose}, closed in by: {shares or 'nothing that is known'}"


def find_closed_area(search: LatticeSearch) -> ClosedArea:
    """Return the smaller one of the areas that start and goal are connected with.

    Edges that were not judged count as open, so that the areas are bounds from above.
    """
    edges = search.edges
    graph, nodes, areas = search.shortest.graph(0.0), edges.nodes, []
    for around_goal, ends in enumerate(search.ends):
        inside = np.zeros(nodes.count, bool)
        crossing = np.zeros(len(edges.codes) + 1, np.int64)
        spread(graph, ends.open_nodes, bool(around_goal), inside, crossing)
        counts: Counter[str] = Counter()
        for code, count in zip([*edges.codes, "off_map"], crossing.tolist(), strict=True):
            counts[code] += count
        counts.update(ends.codes)
        total = max(sum(counts.values()), 1)
        causes = {code: count / total for code, count in counts.most_common() if count}
        places = np.asarray(inside.reshape(*nodes.shape, HEADINGS).any(axis=2))
        area = float(places.sum()) * nodes.cell**2
        areas.append(ClosedArea(bool(around_goal), places, area, causes))
    return min(areas, key=lambda one: one.area)
