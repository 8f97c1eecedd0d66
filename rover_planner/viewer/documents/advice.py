# SPDX-License-Identifier: Apache-2.0
"""Advice on the path that is looked at: sought, told beside the reason of a refusal, and taken."""

from dataclasses import dataclass, replace
from typing import Any

from rover_planner.advice.advise import Advice
from rover_planner.advice.remedy import Remedy
from rover_planner.planning.assumptions import assume
from rover_planner.viewer.state.background_work import Steps
from rover_planner.viewer.state.scenario import Judged, Scenario

PROMISED = 20.0
"""Time after which the page tells what was found so far, and that the search goes on [s]."""


@dataclass(frozen=True, eq=False)
class Advised:
    """A path and the advice on it."""

    path: Judged
    """The path."""
    steps: Steps[Advice]
    """What seeks the advice."""
    since: float
    """When a visitor asked for advice, on the monotonic clock [s]."""
    advice: Advice | None = None
    """What was found so far; None while the first lever is tried."""

    @property
    def remedies(self) -> list[Remedy]:
        """The remedies in the order of the list."""
        return [] if self.advice is None else [*self.advice.remedies, *self.advice.others]

    @property
    def is_complete(self) -> bool:
        """True if all levers were tried."""
        return self.advice is not None and self.advice.complete


def apply_remedy(scenario: Scenario, remedy: Remedy) -> Scenario:
    """Return a scenario with the levers of a remedy set, where the page has its own values.

    Friction, torque, payload and limits are numbers of the rover there, which sliders show.
    """
    case = remedy.judged.case
    has_path, model = case.poses is not remedy.refusal.case.poses, case.options
    return replace(
        scenario,
        rover=assume(case.rover, case.options).change(case.rover),
        options=scenario.options.change(
            policy=model.policy, backward=model.backward, joint_angles=model.joint_angles
        ),
        recorded=case.poses if has_path else scenario.recorded,
    )


def describe_advice(advised: Advised | None, is_seeking: bool, now: float) -> dict[str, Any]:
    """Return what is tried, and the remedies found so far, by their words: more are found.

    A change of the ground is no value of the page: such remedies are told, and not taken.

    Args:
        advised: The advice on the path that is looked at; None if it was not asked for.
        is_seeking: True if levers are still tried.
        now: The monotonic clock [s].
    """
    is_complete = advised is not None and advised.is_complete
    return {
        "can_ask": not is_seeking and not is_complete,
        "seeking": is_seeking,
        "words": "" if advised is None else _write_progress(advised, is_seeking, now),
        "rows": [] if advised is None else [_describe(remedy) for remedy in advised.remedies],
    }


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
    found = len(advised.remedies) or "nothing"
    return f"{found} found so far; the search goes on, tried: {tried or 'nothing yet'}"


def _describe(remedy: Remedy) -> dict[str, Any]:
    can_take = all(one.lever.name != "ground" for one in remedy.levers)
    return {"taken": can_take, "words": remedy.describe(), "costs": remedy.describe_costs()}
