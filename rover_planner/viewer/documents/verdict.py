# SPDX-License-Identifier: Apache-2.0
"""The verdict with its reason, its age, and what a person can do about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rover_planner.viewer.documents.header import POLICY_TITLES
from rover_planner.viewer.documents.limits import write_chance
from rover_planner.viewer.state.failure import Failure
from rover_planner.viewer.state.scenario import PolicyVerdict, Shown

WORDS = {None: "no verdict", True: "traversable", False: "not traversable"}


@dataclass(frozen=True)
class Work:
    """What the program does, and what it could not do."""

    judging: str = ""
    """What is worked on, empty for nothing."""
    old: str = ""
    """Why the verdict is one of old values; empty if it is not."""
    refusal: str = ""
    """Why the last request was refused; empty if it was not."""
    is_stopped: bool = False
    """True if visitors have stopped the work."""


def describe_verdict(shown: Shown, work: Work) -> dict[str, Any]:
    """Return the verdict on the path that is looked at."""
    failure, verdict = shown.path.failure, shown.verdict
    around = shown.around
    closed = "" if around is None or around.path is not None else f"no way: {around.reason}"
    return {
        **describe_answer(verdict.traversable, f"path {shown.index + 1} of {len(shown.paths)}"),
        "headline": "" if failure is None else failure.headline,
        "where": "" if failure is None else write_place(failure),
        "chance": ""
        if shown.chance is None
        else f"chance of failure {write_chance(shown.chance)}",
        "details": [*filter(None, (verdict.reason, closed))],
        "old": work.old,
        "refusal": work.refusal,
        "judging": work.judging,
        "stopped": work.is_stopped,
        "policies": [_describe_policy(one) for one in shown.by_policy],
        "offers": _list_offers(shown),
        "fails": failure is not None,
    }


def describe_answer(traversable: bool | None, about: str) -> dict[str, Any]:
    """Return a bare verdict: what it says and what it is about."""
    return {"passes": traversable, "word": WORDS[traversable], "about": about}


def write_place(failure: Failure) -> str:
    """Return where and when a path is refused."""
    between = ", between waypoints" if failure.is_between else ""
    return f"after {failure.distance:.2f} m, {failure.time:.0f} s{between}"


def _describe_policy(one: PolicyVerdict) -> dict[str, Any]:
    known = one.traversable is not None
    word = ("passes" if one.traversable else "refused") if known else "not judged"
    title = POLICY_TITLES[one.policy]
    passes, reason = one.traversable, one.reason or word
    return {"title": title, "word": word, "passes": passes, "old": one.is_old, "reason": reason}


def _list_offers(shown: Shown) -> Sequence[dict[str, Any]]:
    """Return what a click takes instead of a path that is refused: words, and what it asks."""
    if shown.offer is None:
        return []
    kind = "path" if shown.offer < shown.generated else "way around, path"
    length = shown.paths[shown.offer].candidate.length
    words = f"{kind} {shown.offer + 1} passes ({length:.1f} m)"
    return [{"words": words, "ask": {"ask": "show", "index": shown.offer}}]
