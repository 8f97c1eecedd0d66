# SPDX-License-Identifier: Apache-2.0
"""What is judged, the verdict with its reason and age, and those on all paths."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_planner.viewer.documents.drive import write_chance
from rover_planner.viewer.state.numbers import write, write_use
from rover_planner.viewer.state.scenario import Judged, Scenario, Shown

POLICY_TITLES = {EQUAL: "equal torques", SERVO: "speed servos", OPTIMAL: "traction control"}
"""Names of the torque policies on the page."""
WORDS = {None: "no verdict", True: "traversable", False: "not traversable"}


def describe_subject(scenario: Scenario, ground: str) -> dict[str, str]:
    """Return what a scenario is about, by name, on a ground with a name."""
    rover, terrain, options = scenario.rover, scenario.terrain, scenario.options
    soil = options.model.soil or f"firm, friction {rover.friction:g}"
    if terrain.soil_names:
        soil = f"{', '.join(terrain.soil_names)} on the map"
    return {
        "rover": rover.name + ("" if rover == scenario.loaded else " (changed)"),
        "map": ground,
        "soil": soil,
        "torques": POLICY_TITLES[options.model.policy],
        "mode": "planning" if scenario.recorded is None else "replay",
    }


def describe_verdict(shown: Shown) -> dict[str, Any]:
    """Return the verdict on the path that is looked at."""
    failure, verdict = shown.path.failure, shown.verdict
    around = shown.around
    closed = "" if around is None or around.path is not None else f"no way: {around.reason}"
    return {
        **describe_answer(verdict.traversable, f"path {shown.index + 1} of {len(shown.paths)}"),
        "headline": "" if failure is None else failure.headline,
        "where": "" if failure is None else failure.place,
        "chance": ""
        if shown.chance is None
        else f"chance of failure {write_chance(shown.chance)}",
        "details": [*filter(None, (verdict.reason, closed))],
        "policies": _list_policies(shown),
        "offers": _list_offers(shown),
        "fails": failure is not None,
    }


def describe_answer(traversable: bool | None, about: str) -> dict[str, Any]:
    """Return a bare verdict: what it says and what it is about."""
    return {"passes": traversable, "word": WORDS[traversable], "about": about}


def _list_policies(shown: Shown) -> list[dict[str, Any]]:
    """Return the verdicts under all policies; none for a replay, whose soil is not known."""
    rows = []
    for policy, title in POLICY_TITLES.items() if shown.scenario.recorded is None else ():
        one = shown.by_policy.get(policy)
        passes, reason = (None, "") if one is None else (one.traversable, one.reason)
        word = {None: "not judged", True: "passes", False: "refused"}[passes]
        old = one is None or one.scenario is not shown.scenario
        row = {"title": title, "word": word, "passes": passes, "old": old}
        rows.append({**row, "reason": reason or word})
    return rows


def _list_offers(shown: Shown) -> Sequence[dict[str, Any]]:
    """Return what a click takes instead of a path that is refused: words, and what it asks."""
    if shown.offer is None:
        return []
    kind = "path" if shown.offer < shown.generated else "way around, path"
    length = shown.paths[shown.offer].candidate.length
    words = f"{kind} {shown.offer + 1} passes ({length:.1f} m)"
    return [{"words": words, "ask": {"ask": "show", "index": shown.offer}}]


def describe_paths(
    shown: Shown, is_outdated: bool = False, is_judging: bool = False
) -> dict[str, Any]:
    """Return a row for each path; the numbers of a refused one are up to its first failure.

    Args:
        shown: What is shown.
        is_outdated: True if other values are wanted than those of what is shown.
        is_judging: True if something is judged; else old paths say that they wait.
    """
    every = frozenset(range(len(shown.paths)))
    old = every if is_outdated else shown.old
    waits = "old, is judged" if is_judging else "old, was not judged again"
    rows = [
        _describe_row(path, number=k + 1, waits=waits if k in old else "", best=k == shown.best)
        for k, path in enumerate(shown.paths)
    ]
    return {"rows": rows, "shown": shown.index}


def _describe_row(path: Judged, number: int, waits: str, best: bool) -> dict[str, Any]:
    verdict, length = path.verdict, f"{path.candidate.length:.2f}"
    limits = path.limits
    uses = [float(np.nanmax(one.used, initial=0.0)) for one in limits.lanes]
    most = limits.lanes[int(np.argmax(uses))].title
    word = "passes" if verdict.traversable else "refused"
    return {
        "number": number,
        "passes": verdict.traversable,
        "word": f"{word}, best" if best else word,
        "waits": waits,
        "length": length if verdict.traversable else f"{limits.end:.2f} of {length}",
        "energy": write(path.trajectory.energy, 1),
        "use": write_use(max(uses)),
        "limit": most,
        "reason": verdict.reason,
    }
