# SPDX-License-Identifier: Apache-2.0
"""The list of remedies beside the reason of a refusal."""

from typing import Any

from rover_planner.advice.remedy import Remedy
from rover_planner.viewer.state.path_advice import Advised

PROMISED = 20.0
"""Time after which the page tells what was found so far, and that the search goes on [s]."""


def describe_advice(advised: Advised | None, is_seeking: bool, now: float) -> dict[str, Any]:
    """Return what is tried, and the remedies found so far, by their words: more are found.

    A change of the ground is no value of the page: such remedies are told, and not taken.

    Args:
        advised: The advice on the path that is looked at; None if it was not asked for.
        is_seeking: True if levers are still tried.
        now: The monotonic clock [s].
    """
    rows = list_remedies(advised)
    return {
        "can_ask": not is_seeking and not _is_complete(advised),
        "seeking": is_seeking,
        "words": "" if advised is None else _write_progress(advised, is_seeking, now),
        "rows": [_describe(remedy) for remedy in rows],
    }


def _is_complete(advised: Advised | None) -> bool:
    return advised is not None and advised.advice is not None and advised.advice.complete


def list_remedies(advised: Advised | None) -> list[Remedy]:
    """Return the remedies in the order of the list."""
    advice = None if advised is None else advised.advice
    return [] if advice is None else [*advice.remedies, *advice.others]


def _write_progress(advised: Advised, is_seeking: bool, now: float) -> str:
    """Return how far the search is: what is tried, or what was found at its end."""
    advice = advised.advice
    if not is_seeking:
        if advice is None or not advice.complete:
            return "the search was stopped"
        return "" if advice.found else advice.describe()
    tried = " and ".join(advice.tried).replace("_", " ") if advice is not None else ""
    if now - advised.since < PROMISED:
        return f"tried: {tried or 'nothing yet'}"
    found = len(list_remedies(advised)) or "nothing"
    return f"{found} found so far; the search goes on, tried: {tried or 'nothing yet'}"


def _describe(remedy: Remedy) -> dict[str, Any]:
    can_take = all(one.lever.name != "ground" for one in remedy.levers)
    return {"taken": can_take, "words": remedy.describe(), "costs": remedy.describe_costs()}
