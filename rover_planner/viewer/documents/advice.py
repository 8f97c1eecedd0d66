# SPDX-License-Identifier: Apache-2.0
"""The list of remedies beside the reason of a refusal."""

from typing import Any

from rover_planner.advice.advise import Advice
from rover_planner.advice.remedy import Remedy


def describe_advice(advice: Advice | None, is_asked: bool, is_busy: bool) -> dict[str, Any]:
    """Return what a person may ask, what is tried, and the remedies; `index` where one is taken.

    A change of the ground is no value of the page: such remedies are only told.
    """
    if not is_asked:
        return {"asked": False, "busy": "", "words": "", "rows": []}
    tried = " and ".join(advice.tried).replace("_", " ") if advice is not None else ""
    rows = list_remedies(advice) if advice is not None else []
    return {
        "asked": True,
        "busy": f"tried: {tried or 'nothing yet'}" if is_busy else "",
        "words": "" if is_busy or rows or advice is None else advice.describe(),
        "rows": [_describe(index, remedy) for index, remedy in enumerate(rows)],
    }


def list_remedies(advice: Advice) -> list[Remedy]:
    """Return the remedies in the order of the list."""
    return [*advice.remedies, *advice.others]


def _describe(index: int, remedy: Remedy) -> dict[str, Any]:
    can_take = all(one.lever.name != "ground" for one in remedy.levers)
    costs = remedy.describe_costs()
    return {"index": index if can_take else None, "words": remedy.describe(), "costs": costs}
