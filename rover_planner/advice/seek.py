# SPDX-License-Identifier: Apache-2.0
"""Seeks the smallest changes of levers that make a refused path pass.

One lever comes before two, two before three. A lever with a range is tried in steps from its value
now to both ends; between the first step that passes and the one before, the least value is found
by bisection. Poses that an earlier trial failed at come first: who fails there needs no sweep.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

from rover_physics.errors import RoverError
from rover_physics.limits.table import CHANCE, TRAPPED
from rover_planner.advice.case import Case, JudgedCase
from rover_planner.advice.levers import LEVERS, Choice, Lever, Span
from rover_planner.advice.refusal import Refusal
from rover_planner.advice.remedy import Remedy, SetLever

STEPS = 10
"""Steps from the value of a lever to its end."""
TOLERANCE = 0.02
"""Tolerance of the least value [share of the range]."""
COARSE = ((), (), (0.3, 0.6, 1.0), (0.5, 1.0))
"""Steps [share of the range] that are tried of each of two and of three levers."""
OF_WHOLE_PATH = (TRAPPED, CHANCE)
"""Codes of failures that a piece of the path does not show."""
MOST_LEVERS = 3
"""Largest number of levers that are set at once."""

Values = tuple[Any, ...]
"""A value for each of a few levers."""


@dataclass(frozen=True)
class Trial:
    """What has been tried: a few levers, and the remedy if there is one."""

    levers: tuple[Lever, ...]
    """The levers."""
    remedy: Remedy | None
    """Their least setting that passes."""


def seek_remedies(refusal: Refusal) -> Iterator[Trial]:
    """Yield all trials: one lever after the other, and several of them if none helps alone.

    Only what the rover does by itself is combined; three only of levers that keep the rows of the
    path, as the others have to be judged as a whole.
    """
    seeker = _Seeker(refusal)
    own = [lever for lever in LEVERS if not lever.needs_others]
    usable, helped = [], False
    for lever in LEVERS:
        if lever.settings(refusal) is None:
            continue
        remedy = seeker.seek((lever,))
        yield Trial((lever,), remedy)
        if lever in own:
            usable.append(lever)
            helped = helped or remedy is not None
    for count in range(2, MOST_LEVERS + 1):
        if helped:
            return
        for levers in combinations(usable, count):
            if sum(lever.changes_path for lever in levers) > 1:
                continue
            if count == MOST_LEVERS and not all(lever.keeps_rows for lever in levers):
                continue
            remedy = seeker.seek(levers)
            yield Trial(levers, remedy)
            helped = helped or remedy is not None


class _Seeker:
    """Tries settings of levers on a refused path, and remembers where it failed."""

    def __init__(self, refusal: Refusal):
        self._refusal = refusal
        self._failed: list[int] = []
        self._note(refusal.judged)

    def seek(self, levers: Sequence[Lever]) -> Remedy | None:
        """Return the remedy of a few levers, None if there is none."""
        ranges = [_range_of(lever, self._refusal) for lever in levers]
        shares = [_shares(one, len(levers)) for one in ranges]
        # The nearest come first.
        for chosen in sorted(product(*shares), key=lambda some: sum(map(abs, some))):
            if self._judge(levers, _values(ranges, chosen)) is not None:
                return self._shrink(levers, ranges, list(chosen))
        return None

    def _shrink(
        self, levers: Sequence[Lever], ranges: Sequence[Span | Choice], shares: list[float]
    ) -> Remedy | None:
        """Return the remedy with the least shares of the ranges, one lever after the other."""
        step = 1.0 / STEPS if len(levers) == 1 else 1.0
        for k, one in enumerate(ranges):
            if isinstance(one, Choice):
                continue
            passes = shares[k]
            sign = 1.0 if passes > 0.0 else -1.0
            fails = sign * max(0.0, abs(passes) - step)
            while abs(passes - fails) > TOLERANCE:
                shares[k] = 0.5 * (passes + fails)
                if self._judge(levers, _values(ranges, shares)) is not None:
                    passes = shares[k]
                else:
                    fails = shares[k]
            shares[k] = passes
        values = _values(ranges, shares)
        judged = self._judge(levers, values)
        if judged is None:
            return None
        told = zip(levers, values, ranges, strict=True)
        return Remedy(
            self._refusal,
            tuple(SetLever(lever, value, one.now) for lever, value, one in told),
            judged,
        )

    def _judge(self, levers: Sequence[Lever], values: Values) -> JudgedCase | None:
        """Return the case with levers set if it passes, else None."""
        case: Case | None = self._refusal.case
        try:
            for lever, value in zip(levers, values, strict=True):
                if case is not None:
                    case = lever.apply(case, self._refusal, value)
            if case is None:
                return None
            keeps_rows = all(lever.keeps_rows for lever in levers)
            for place in self._failed if keeps_rows else ():
                if not case.passes_at(self._refusal.rows_around(place, case.options.policy)):
                    return None
            judged = case.judge()
        except RoverError:
            return None  # the rover cannot be asked for it
        if judged.passes:
            return judged
        if keeps_rows:
            self._note(judged)
        return None

    def _note(self, judged: JudgedCase) -> None:
        """Remember where a case failed."""
        if judged.verdict.code not in OF_WHOLE_PATH:
            self._failed.insert(0, judged.verdict.first_failure)


def _range_of(lever: Lever, refusal: Refusal) -> Span | Choice:
    found = lever.settings(refusal)
    assert found is not None
    return found


def _shares(settings: Span | Choice, count: int) -> list[float]:
    """Return what to try of a lever among `count`: shares to its ends, negative to the first.

    The values of a choice are 1, 2, ...
    """
    if isinstance(settings, Choice):
        return [float(k + 1) for k in range(len(settings.values))]
    steps = COARSE[count] or [(k + 1) / STEPS for k in range(STEPS)]
    signs = (-1.0, 1.0) if len(settings.ends) == 2 else (1.0,)
    return [sign * step for step in steps for sign in signs]


def _values(ranges: Sequence[Span | Choice], shares: Sequence[float]) -> Values:
    """Return the values of levers at shares of their ranges."""
    values: list[Any] = []
    for settings, share in zip(ranges, shares, strict=True):
        if isinstance(settings, Choice):
            values.append(settings.values[int(share) - 1])
        else:
            end = settings.ends[0 if share < 0.0 else -1]
            values.append(settings.now + abs(share) * (end - settings.now))
    return tuple(values)
