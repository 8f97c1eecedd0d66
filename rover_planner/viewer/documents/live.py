# SPDX-License-Identifier: Apache-2.0
"""The answer that a live page shows: whose question it is, how old it is, and whether it holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.documents.verdict import describe_answer
from rover_planner.viewer.live.live_state import LearnedTrail, LiveData, TopicAge

PATIENCE = 2.0
"""Time after which a click without an answer says so [s]."""


@dataclass(frozen=True, eq=False)
class LiveAnswer:
    """The one answer that is shown, in words and in the scene."""

    document: dict[str, Any]
    """As `describe_verdict` returns it."""
    plan: Floats | None
    """(n, 3) poses of its plan; None without one."""

    @property
    def is_old(self) -> bool:
        """True if nobody stands for it any more."""
        return bool(self.document["old"])


def choose_answer(data: LiveData, now: float, refusal: str = "") -> LiveAnswer:
    """Return the answer to the last click, or without one the server's newest.

    Args:
        data: The latest data.
        now: The monotonic clock [s].
        refusal: Why a visitor's last request was refused; empty if it was not.
    """
    newest, click, server = data.verdict, data.click, data.server
    verdict, offers = (newest if click is None else click.verdict), []
    if verdict is not None:
        whose = "your click" if click is not None else verdict.question
        answer = describe_answer(verdict.traversable, f"{whose}, {write_age(now - verdict.heard)}")
        headline = verdict.reason
    elif click is not None:
        waited = now - click.asked
        late = waited > PATIENCE
        answer = describe_answer(None, f"your click, {write_age(waited)}")
        headline = f"no answer from the server for {waited:.0f} s" if late else "asking the server"
    else:
        answer = describe_answer(None, "")
        headline = "click the ground to ask for a plan"
    if click is not None and newest is not None and newest is not click.verdict:
        word = "traversable" if newest.traversable else "not traversable"
        words = f"{newest.question}: {word}, {write_age(now - newest.heard)}"
        offers = [
            {"words": words + (", old" if server.is_stale else ""), "ask": {"ask": "newest"}}
        ]
    old = ""
    if verdict is not None and server.is_stale:
        old = f"the server is silent for {server.describe()}"
    shown = data.plan if click is None else click.plan
    document = {**answer, "headline": headline, "old": old, "refusal": refusal, "offers": offers}
    return LiveAnswer(document, shown)


def write_age(seconds: float) -> str:
    """Return an age in words, in steps that do not change all the time."""
    return "just now" if seconds < PATIENCE else f"{seconds:.0f} s ago"


def describe_learned(learned: LearnedTrail | None) -> list[str]:
    """Return what was learned of the ground in words; none before the first estimate."""
    if learned is None:
        return []
    ground = learned.ground
    words = f"friction {ground.mean:.2f}, give or take {ground.std:.2f}: wheels have slipped"
    if not ground.is_bounded:
        words = f"friction at least {ground.low:.2f}: no wheel has slipped yet"
    return [words, "where: the trail in the scene, from blue (0) to yellow (1)"]


def list_topics(ages: Sequence[TopicAge]) -> list[dict[str, Any]]:
    """Return the topics of a live rover with their ages."""
    return [{"topic": one.topic, "age": one.describe(), "stale": one.is_stale} for one in ages]
