# SPDX-License-Identifier: Apache-2.0
"""Advice on the path that is looked at: sought, told beside the reason of a refusal, and taken."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from rover_planner.advice.advise import STOPPED, Advice, grow_advice
from rover_planner.advice.case import case_of
from rover_planner.advice.remedy import Remedy
from rover_planner.viewer.state.scenario import JudgedPath, Scenario

PROMISED = 20.0
"""Time after which the page tells what was found so far, and that the search goes on [s]."""


@dataclass(frozen=True, eq=False)
class Advised:
    """A path and the advice on it."""

    path: JudgedPath
    """The path."""
    since: float
    """When a visitor asked for advice, on the monotonic clock [s]."""
    advice: Advice | None = None
    """Advice that was found so far; None before the first result."""

    @property
    def remedies(self) -> list[Remedy]:
        """The remedies in the order of the list."""
        found = self.advice
        return [] if found is None else [*found.remedies, *found.others]


def seek_advice(advised: Advised) -> Iterator[Advised]:
    """Yield the advice on a path as it grows.

    Raises:
        RoverError: The model refuses the path or an option.
    """
    case = case_of(advised.path.scenario.site, advised.path.poses)
    for found in grow_advice(case):
        yield replace(advised, advice=found)


def apply_remedy(scenario: Scenario, remedy: Remedy) -> Scenario:
    """Return a scenario with the levers of a remedy set, where the page has its own values.

    Friction, torque, payload and limits are numbers of the rover there, which sliders show.
    """
    case = remedy.judged.case
    has_path, model = case.poses is not remedy.refusal.case.poses, case.options
    return replace(
        scenario,
        rover=case.site.assumed_rover,
        options=scenario.options.change(
            policy=model.policy, backward=model.backward, joint_angles=model.joint_angles
        ),
        recorded=case.poses if has_path else scenario.recorded,
    )


def describe_advice(advised: Advised | None, is_seeking: bool, now: float) -> dict[str, Any]:
    """Return what is tried, and the remedies found so far, by their words: more are found.

    A change of the ground is no value of the page: such remedies are told, and not taken.

    Args:
        advised: The advice on the path that is looked at; None if none was sought.
        is_seeking: True if levers are still tried.
        now: The monotonic clock [s].
    """
    advice = None if advised is None else advised.advice
    is_complete = advice is not None and advice.complete
    rows = [
        {
            "taken": all(one.lever.name != "ground" for one in remedy.levers),
            "words": remedy.describe(),
            "costs": remedy.describe_costs(),
        }
        for remedy in ([] if advised is None else advised.remedies)
    ]
    words = _write_progress(advised, is_seeking, now)
    can_ask = not is_seeking and not is_complete
    return {"can_ask": can_ask, "seeking": is_seeking, "words": words, "rows": rows}


def _write_progress(advised: Advised | None, is_seeking: bool, now: float) -> str:
    """Return how far the search is: what is tried, or what was found at its end."""
    if advised is None:
        return ""
    advice = advised.advice
    if not is_seeking and advice is not None and advice.complete:
        return "" if advice.found else advice.describe()
    if not is_seeking:
        return "the search was stopped" if advised.remedies else STOPPED
    names = () if advice is None else advice.tried
    tried = f"tried: {' and '.join(names).replace('_', ' ') or 'nothing yet'}"
    found = len(advised.remedies) or "nothing"
    is_late = now - advised.since >= PROMISED
    return f"{found} found so far; the search goes on, {tried}" if is_late else tried
