# SPDX-License-Identifier: Apache-2.0
"""The paths as rows of a table; the numbers of a refused one are up to its first failure."""

from typing import Any

import numpy as np

from rover_planner.viewer.documents.numbers import write
from rover_planner.viewer.state.limits import write_use
from rover_planner.viewer.state.scenario import Judged, Shown


def list_paths(shown: Shown, *, is_outdated: bool, is_judging: bool) -> list[dict[str, Any]]:
    """Return a row for each path.

    Args:
        shown: What is shown.
        is_outdated: True if other values are wanted than those of what is shown.
        is_judging: True if something is judged; else old paths say that they wait.
    """
    every = frozenset(range(len(shown.paths)))
    old = every if is_outdated else shown.old
    waits = "old, is judged" if is_judging else "old, was not judged again"
    return [
        _describe_row(path, number=k + 1, waits=waits if k in old else "", best=k == shown.best)
        for k, path in enumerate(shown.paths)
    ]


def _describe_row(path: Judged, number: int, waits: str, best: bool) -> dict[str, Any]:
    verdict, length = path.verdict, f"{path.candidate.length:.2f}"
    limits = path.limits
    uses = [float(np.nanmax(one.used, initial=0.0)) for one in limits.lanes]
    most = limits.lanes[int(np.argmax(uses))].limit.title
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
