# SPDX-License-Identifier: Apache-2.0
"""The report on a search for a way, as plain values for JSON."""

from typing import Any

from rover_physics.numerics.plain_values import to_plain
from rover_planner.planning.ways.way_search import FOUND, WayAnswer


def report_way(answer: WayAnswer) -> dict[str, Any]:
    """Return the report on a search; numbers that are not known are None.

    Lengths are in m, energy in J, times in s. Risk is the used share of the tightest safety limit.
    """
    path = answer.path
    prediction = None if path is None else path.prediction
    report: dict[str, Any] = to_plain(
        {
            "found": answer.outcome == FOUND,
            "outcome": answer.outcome,
            "reason": answer.reason,
            "length": None if path is None else path.length,
            "energy": None if prediction is None else float(prediction.energy[-1]),
            "time": None if prediction is None else float(prediction.time[-1]),
            "risk": None if path is None else path.verdict.risk,
            "cost": answer.cost,
            "expanded": answer.expanded,
            "edges_judged": answer.edges_judged,
            "edges": answer.edges,
            "seconds_first": answer.seconds_first,
            "seconds": answer.seconds,
            "bound": answer.bound,
            "repeatable": answer.repeatable,
            "warning": answer.warning,
            "closed_area": None if answer.closed is None else answer.closed.area,
            "closed_by": None if answer.closed is None else answer.closed.causes,
        }
    )
    return report
