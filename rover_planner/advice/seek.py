# SPDX-License-Identifier: Apache-2.0
"""Seeks the smallest changes of levers that make a refused path pass.

One lever comes before two, two before three. A lever with a range is tried in steps from its value
now to both ends; between the first step that passes and the one before, the least value is found
by bisection. Who fails where the refused path does needs no sweep of the whole path.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import numpy as np

from rover_physics.errors import RoverError
from rover_planner.advice.case import JudgedCase
from rover_planner.advice.levers import LEVERS, Choice, Lever, Span
from rover_planner.advice.remedy import Remedy, SetLever

TOLERANCE = 0.02
"""Tolerance of the least value [share of the range]."""
COARSE, FINE = (tuple((k + 1) / count for k in range(count)) for count in (10, 50))
ROUNDS = ((1, COARSE), (1, FINE), (2, (0.3, 0.6, 1.0)), (3, (0.5, 1.0)))
"""Number of levers, and steps [share of the range] of each of them, as they are tried."""

Asked = tuple[tuple[Lever, Span | Choice], ...]
"""A few levers, and what each may be set to."""


def seek_remedies(refusal: JudgedCase) -> Iterator[tuple[tuple[Lever, ...], Remedy | None]]:
    """Yield all trials: one lever after the other, and several of them if none helps alone.

    Each is a few levers, and the remedy of their least setting that passes, if there is one. Only
    what the rover does by itself is tried in fine steps and combined.
    """
    helped = False
    own = [lever for lever in LEVERS if not lever.needs_others]
    for count, steps in ROUNDS:
        for levers in combinations(LEVERS if steps is COARSE else own, count):
            ranges = [(lever, lever.settings(refusal)) for lever in levers]
            asked = tuple((lever, one) for lever, one in ranges if one is not None)
            if not can_combine(levers) or len(asked) < count:
                continue
            if steps is FINE and isinstance(asked[0][1], Choice):
                continue
            remedy = _seek(refusal, asked, steps)
            yield levers, remedy
            helped = helped or (remedy is not None and not remedy.needs_others)
        if helped:
            return


def can_combine(levers: Sequence[Lever]) -> bool:
    """Return whether levers may be set at once: three only if all keep the rows of the path.

    The others have to be judged as a whole.
    """
    if sum(lever.changes_path for lever in levers) > 1:
        return False
    return len(levers) < 3 or all(lever.keeps_rows for lever in levers)


def _seek(refusal: JudgedCase, asked: Asked, steps: Sequence[float]) -> Remedy | None:
    """Return the remedy of levers in steps [share of the range], None if there is none."""
    shares = [one.shares(steps) for _, one in asked]
    # The nearest come first.
    for chosen in sorted(product(*shares), key=lambda some: sum(map(abs, some))):
        judged = _judge(refusal, asked, chosen)
        if judged is not None:
            step = steps[0] if len(asked) == 1 else 1.0
            least, judged = _shrink(refusal, asked, list(chosen), judged, step)
            set_levers = tuple(
                SetLever(lever, one.value_at(share), one.now)
                for (lever, one), share in zip(asked, least, strict=True)
            )
            return Remedy(refusal, set_levers, judged)
    return None


def _shrink(
    refusal: JudgedCase, asked: Asked, shares: list[float], judged: JudgedCase, step: float
) -> tuple[list[float], JudgedCase]:
    """Return the least shares of the ranges that pass, one lever after the other, as judged.

    The given ones pass; less by `step` may fail.
    """
    for k, (_, one) in enumerate(asked):
        if isinstance(one, Choice):
            continue
        passes = shares[k]
        fails = float(np.sign(passes)) * max(0.0, abs(passes) - step)
        while abs(passes - fails) > TOLERANCE:
            shares[k] = 0.5 * (passes + fails)
            found = _judge(refusal, asked, shares)
            if found is None:
                fails = shares[k]
            else:
                passes, judged = shares[k], found
        shares[k] = passes
    return shares, judged


def _judge(refusal: JudgedCase, asked: Asked, shares: Sequence[float]) -> JudgedCase | None:
    """Return the refused case with levers set if it passes, else None."""
    case = refusal.case
    try:
        for (lever, one), share in zip(asked, shares, strict=True):
            changed = lever.apply(case, refusal, one.value_at(share))
            if changed is None:
                return None
            case = changed
        if all(lever.keeps_rows for lever, _ in asked) and refusal.fails_alike(case):
            return None
        judged = case.judge()
    except RoverError:
        return None  # the rover cannot do that
    return judged if judged.passes else None
