# SPDX-License-Identifier: Apache-2.0
"""The worst use of each limit so far, as the board shows it."""

from dataclasses import dataclass

import numpy as np

from rover_physics.names import WHEELS
from rover_planner.viewer.state.reasons.limits import GROUND
from rover_planner.viewer.state.reasons.path_limits import Lane, PathLimits, Use


@dataclass(frozen=True)
class WorstUse:
    """The worst use of one limit up to a time of the drive."""

    title: str
    """Short name of the limit."""
    value: str
    """The value nearest to the limit, as text."""
    bound: str
    """What keeps the limit, with its unit, such as "max 1.00"; empty if it is no single number."""
    used: float
    """Share of the limit that is used."""
    is_broken: bool
    """Whether it is broken."""
    wheel: str
    """The wheel concerned, empty for none."""


def find_worst(limits: PathLimits, time: float) -> tuple[WorstUse, ...]:
    """Return the worst use of each limit with a number up to a time [s]."""
    rows = int(np.searchsorted(limits.rows.time, time + 1e-6, side="right"))
    return tuple(
        _worst(lane, rows)
        for lane in limits.lanes
        if lane.limit.code not in (GROUND, "suspension", "wheel_lift")
    )


def _worst(lane: Lane, rows: int) -> WorstUse:
    at, limit = lane.worst_until(rows), lane.limit
    if at < 0:
        return WorstUse(limit.title, "?", "", 0.0, False, "")
    value, used = float(lane.values[at]), float(lane.used[at])
    broken = bool(lane.use[at] == Use.BROKEN)
    wheel = WHEELS[lane.wheel[at]] if lane.wheel[at] >= 0 and value > 0.0 else ""
    if limit.bound is None:
        share = "?" if np.isnan(used) else f"{100.0 * used:.0f} %"
        return WorstUse(limit.title, "broken" if broken else share, "", used, broken, wheel)
    word = "min" if limit.is_lowest else "max"
    bound = f"{word} {limit.write(limit.bound)} {limit.unit}".strip()
    return WorstUse(limit.title, limit.write(value), bound, used, broken, wheel)
