# SPDX-License-Identifier: Apache-2.0
"""Seeks remedies: the smallest changes of levers that make a refused path pass.

One lever comes before two, two before three. A lever with a range is tried in steps from its value
now to both ends; between the first step that passes and the one before, the least value is found
by bisection. Who fails where the refused path does needs no sweep of the whole path.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np

from rover_physics.errors import RoverError
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.numerics.plain_values import to_plain
from rover_planner.advice.case import JudgedCase
from rover_planner.advice.levers import LEVERS, Choice, Lever, Span

TELLING_LOAD = 0.01
"""Least change of an axle's load that is told [share of the weight]."""
TOLERANCE = 0.02
"""Tolerance of the least value [share of the range]."""
COARSE, FINE = (tuple((k + 1) / count for k in range(count)) for count in (10, 50))
ROUNDS = ((1, COARSE), (1, FINE), (2, (0.3, 0.6, 1.0)), (3, (0.5, 1.0)))
"""Number of levers, and steps [share of the range] of each of them, as they are tried."""

Asked = tuple[tuple[Lever, Span | Choice], ...]
"""A few levers, and what each may be set to."""


@dataclass(frozen=True)
class SetLever:
    """A lever and the value it is set to."""

    lever: Lever
    """The lever."""
    value: Any
    """Its value."""
    now: Any
    """Its value in the refused case."""


@dataclass(frozen=True, eq=False)
class Remedy:
    """Levers whose setting makes a refused path pass, as judged."""

    refusal: JudgedCase
    """The refused path."""
    levers: tuple[SetLever, ...]
    """The levers, one or a few."""
    judged: JudgedCase
    """The whole path with the levers set."""

    @property
    def needs_others(self) -> bool:
        """True if somebody outside the rover has to do, know or decide something."""
        return any(one.lever.needs_others for one in self.levers)

    @property
    def is_option(self) -> bool:
        """True if `predict` can be told all of it."""
        return all(one.lever.option or one.lever.changes_path for one in self.levers)

    @property
    def extra_time(self) -> float:
        """Time of the drive above that of the refused path [s]."""
        return float(self.judged.prediction.time[-1]) - self.refusal.time

    @property
    def extra_energy(self) -> float:
        """Energy of the drive above that of the refused path [J]."""
        return float(self.judged.prediction.energy[-1]) - self.refusal.energy

    @property
    def extra_distance(self) -> float:
        """Length of the path above that of the refused one [m]."""
        return float(self.judged.distance[-1] - self.refusal.distance[-1])

    def describe_costs(self) -> str:
        """Return time, distance, energy and chance in words."""
        distance = f"{self.extra_distance:+.1f} m, " if abs(self.extra_distance) > 0.05 else ""
        return (
            f"{round(self.extra_time):+d} s, {distance}{round(self.extra_energy):+d} J, "
            f"chance of failure {self.judged.verdict.failure_chance:.2f}"
        )

    def options(self) -> dict[str, Any]:
        """Return the options of `predict` that the levers set."""
        new = self.judged.case.options
        found = {name: getattr(new, name) for one in self.levers if (name := one.lever.option)}
        if "joint_angles" in found:
            found["joint_angles"] = new.arm_angles
        return found

    def describe(self) -> str:
        """Return what to do, what it does to the rover and how close it is, in words."""
        todo = " and ".join(
            words if k == 0 else words[0].lower() + words[1:]
            for k, words in enumerate(
                one.lever.words(self.refusal, one.value, one.now) for one in self.levers
            )
        )
        use, distance, limit = self.judged.largest_use
        loads = self._describe_loads()
        return f"{todo}{loads}; largest use {use:.2f} at {distance:.1f} m ({limit})"

    def _describe_loads(self) -> str:
        """Return how the load of the axle changes most where the refused path fails."""
        if self.judged.case.poses is not self.refusal.case.poses:
            return ""
        both = (self.refusal, self.judged)
        old, new = (one.prediction.wheel_loads[self.refusal.place] for one in both)
        change = (new - old).reshape(2, 3).sum(axis=0)  # of each axle
        most = int(np.abs(change).argmax())
        if not abs(change[most]) > TELLING_LOAD * self.refusal.case.rover.weight:
            return ""  # or unknown
        more, axle = "more" if change[most] > 0.0 else "less", WHEEL_POSITIONS[most]
        return f": the {axle} wheels then carry {abs(change[most]):.1f} N {more}"

    def to_dict(self) -> dict[str, Any]:
        """Return the remedy as JSON types."""
        case, use = self.judged.case, self.judged.largest_use[0]
        has_path = case.poses is not self.refusal.case.poses
        found = {
            "levers": [
                {"name": k.lever.name, "value": k.value, "unit": k.lever.unit, "from": k.now}
                for k in self.levers
            ],
            "words": self.describe(),
            "options": self.options(),
            "largest_use": use,
            "use_before": self.refusal.largest_use[0],
            "chance": self.judged.verdict.failure_chance,
            "extra_time": self.extra_time,
            "extra_energy": self.extra_energy,
            "extra_distance": self.extra_distance,
            "needs_others": self.needs_others,
        }
        plain: dict[str, Any] = to_plain(found)
        return plain | ({"poses": case.poses.tolist()} if has_path else {})


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
