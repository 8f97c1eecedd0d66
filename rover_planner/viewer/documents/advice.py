# SPDX-License-Identifier: Apache-2.0
"""Advice on the path that is looked at: told beside the reason of a refusal, and taken."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rover_planner.advice.advise import STOPPED, Advice
from rover_planner.advice.seek import Remedy
from rover_planner.viewer.state.scenario import Scenario

PROMISED = 20.0
"""Time after which the page tells what was found so far, and that the search goes on [s]."""


def list_remedies(advice: Advice | None) -> Sequence[Remedy]:
    """Return the remedies in the order of the list."""
    return () if advice is None else (*advice.remedies, *advice.others)


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


def describe_advice(
    advice: Advice | None, sought_at: float | None, is_seeking: bool, now: float
) -> dict[str, Any]:
    """Return what is tried, and the remedies found so far, by their words: more are found.

    A change of the ground is no value of the page: such remedies are told, and not taken.

    Args:
        advice: Advice on the path that is looked at, as found so far; None before the first.
        sought_at: When a visitor asked for it, on the monotonic clock [s]; None if nobody has.
        is_seeking: True if levers are still tried.
        now: The monotonic clock [s].
    """
    is_complete = advice is not None and advice.complete
    rows = [
        {
            "taken": all(one.lever.name != "ground" for one in remedy.levers),
            "words": remedy.describe(),
            "costs": remedy.describe_costs(),
        }
        for remedy in list_remedies(advice)
    ]
    words = ""
    if sought_at is not None:
        words = _write_progress(advice, is_seeking, now - sought_at >= PROMISED)
    can_ask = not is_seeking and not is_complete
    return {"can_ask": can_ask, "seeking": is_seeking, "words": words, "rows": rows}


def _write_progress(advice: Advice | None, is_seeking: bool, is_late: bool) -> str:
    """Return how far the search is: what is tried, or what was found at its end."""
    found = list_remedies(advice)
    if not is_seeking and advice is not None and advice.complete:
        return "" if advice.found else advice.describe()
    if not is_seeking:
        return "the search was stopped" if found else STOPPED
    names = () if advice is None else advice.tried
    tried = f"tried: {' and '.join(names).replace('_', ' ') or 'nothing yet'}"
    many = len(found) or "nothing"
    return f"{many} found so far; the search goes on, {tried}" if is_late else tried
