# SPDX-License-Identifier: Apache-2.0
"""The limits along a path, as lanes and curves of their uses, beside those of the reference."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.chance.failure_chance import FailureChance
from rover_physics.limits.table import CHANCE
from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.documents.numbers import plain
from rover_planner.viewer.state.limits import MAX_USE, write_use
from rover_planner.viewer.state.path_limits import Lane, PathLimits, make_chance_lane
from rover_planner.viewer.state.scenario import Judged

MAX_POINTS = 240
"""Most points of a curve."""
HALF, MUCH = 0.5, 0.8
"""Uses at which the colour changes."""
CLASSES = ("little", "half", "near", "broken", "unasked")
"""Classes of colours: up to HALF, up to MUCH, up to the limit, beyond it, not asked."""
BROKEN, NOT_ASKED = 3, 4


def describe_limits(
    path: Judged, reference: Judged | None, chance: FailureChance | None = None
) -> dict[str, Any]:
    """Return the lanes of a path, those of the same path for the reference, and of its chance."""
    failure, before = path.failure, None if reference is None else reference.limits
    end = max(path.limits.end, 0.0 if before is None else before.end)
    lanes = [
        {
            "code": lane.limit.code,
            "title": lane.limit.title,
            "pieces": list(_list_pieces(lane, path.limits)),
            "before": _list_before(lane, before),
        }
        for lane in list_lanes(path, chance)
    ]
    return {
        "end": round(end, 4),
        "fails": None if failure is None else round(failure.distance, 4),
        "code": "" if failure is None else path.limits.lane(failure.code).limit.code,
        "compared": reference is not None,
        "lanes": lanes,
        "loads": _describe_loads(path),
    }


def list_lanes(path: Judged, chance: FailureChance | None) -> list[Lane]:
    """Return the lanes of the limits, and the one of the chance of failure if it is known."""
    lanes = list(path.limits.lanes)
    return lanes if chance is None else [*lanes, make_chance_lane(path.limits, chance)]


def describe_curves(
    path: Judged, reference: Judged | None, chance: FailureChance | None = None
) -> dict[str, Any]:
    """Return the uses of each limit along a path, by code; six curves where wheels have it."""
    curves = {}
    for lane in list_lanes(path, chance):
        values = lane.used[:, None] if lane.wheels is None else lane.wheels
        curve = _pick_points(path.limits.rows.distance, values)
        old = None
        if reference is not None and lane.limit.code != CHANCE:
            limits = reference.limits
            old = _pick_points(limits.rows.distance, limits.lane(lane.limit.code).used[:, None])
        curves[lane.limit.code] = {**curve, "old": old}
    return curves


def describe_uses(
    path: Judged, time: float, chance: FailureChance | None = None
) -> list[dict[str, Any]]:
    """Return for each lane its use at a time [s] and the worst so far, with value and wheel."""
    limits, failure = path.limits, path.failure
    rows = limits.rows_until(time)
    here = rows - 1
    if failure is not None and time >= failure.time - 1e-6:
        rows, here = max(rows, failure.row + 1), failure.row
    lanes = list_lanes(path, chance)
    uses = [_describe_use(lane, limits, lane.worst_until(rows), here) for lane in lanes]
    if chance is not None:
        uses[-1]["value"] = f"whole path {100.0 * chance.path:.0f} %"
    return uses


def write_chance(chance: FailureChance) -> str:
    """Return the chance that a path fails, and its main cause, in words."""
    cause = f", most often by {chance.limit}" if chance.limit else ""
    return f"{100.0 * chance.path:.0f} %{cause}"


def _describe_use(lane: Lane, limits: PathLimits, worst: int, here: int) -> dict[str, Any]:
    kept = float(limits.rows.prediction.results["kept_share"][max(worst, 0)])
    limit = lane.limit.keep(kept) if np.isfinite(kept) else lane.limit
    used = float(lane.used[worst]) if worst >= 0 else np.nan
    value = float(lane.values[worst]) if worst >= 0 else np.nan
    wheel = int(lane.wheel[worst]) if worst >= 0 and used > 0.0 else -1
    return {
        "now": write_use(float(lane.used[here])),
        "worst": write_use(used),
        "share": plain(min(used, 1.0), 2),
        "broken": bool(used > 1.0),
        "value": "" if np.isnan(value) else f"{limit.write(value)}, {limit.good}",
        "wheel": WHEELS[wheel].replace("_", " ") if wheel >= 0 else "",
    }


def _describe_loads(path: Judged) -> dict[str, Any]:
    """Return the wheel loads [N] along a path while the rover stands."""
    rows = path.limits.rows
    stands = rows.prediction.settled
    return _pick_points(rows.distance[stands], rows.prediction.wheel_loads[stands], 1)


def classify(used: Floats) -> NDArray[np.intp]:
    """Return the index (m,) in CLASSES of each use (m,)."""
    shares = np.select([used <= HALF, used <= MUCH], [0, 1], 2)
    return np.select([used > 1.0, np.isnan(used)], [BROKEN, NOT_ASKED], shares)


def _list_runs(lane: Lane, limits: PathLimits) -> Iterator[tuple[int, int, float, float, int]]:
    """Yield first row, end, begin and end [m], and class of each stretch of one class."""
    distance = limits.rows.distance
    edges = np.concatenate([[0.0], 0.5 * (distance[1:] + distance[:-1]), distance[-1:]])
    first = 0
    for kind, run in itertools.groupby(classify(lane.used).tolist()):
        end = first + len(list(run))
        yield first, end, float(edges[first]), float(edges[end]), kind
        first = end


def _list_pieces(lane: Lane, limits: PathLimits) -> Iterator[list[Any]]:
    """Yield begin and end [m], class and words of each stretch, broken ones last, on top."""
    for first, end, left, right, kind in sorted(
        _list_runs(lane, limits), key=lambda run: run[4] == BROKEN
    ):
        words = f"{lane.limit.title}: does not count or is not known"
        if kind != NOT_ASKED:
            at = first + int(np.argmax(np.nan_to_num(lane.used[first:end], nan=-1.0, posinf=1e9)))
            wheel = int(lane.wheel[at])
            named = f", {WHEELS[wheel].replace('_', ' ')}" if wheel >= 0 else ""
            words = f"{lane.limit.title} {write_use(float(lane.used[at]))}{named}"
        yield [round(left, 4), round(right, 4), CLASSES[kind], f"{words}; at {left:.2f} m"]


def _list_before(lane: Lane, before: PathLimits | None) -> list[list[Any]]:
    """Return begin, end [m] and class of each stretch of a lane of the reference."""
    if before is None or lane.limit.code == CHANCE:
        return []
    runs = _list_runs(before.lane(lane.limit.code), before)
    return [[round(left, 4), round(right, 4), CLASSES[kind]] for _, _, left, right, kind in runs]


def _pick_points(distance: Floats, values: Floats, digits: int = 3) -> dict[str, Any]:
    """Return x (j,) and curves y (k, j) of values (m, k) with all peaks and dips.

    What is infinite is MAX_USE: a use without bound is above the limit, no gap.
    """
    rows = choose_rows(values)
    y = np.where(np.isposinf(values[rows]), MAX_USE, values[rows]).T
    return {"x": plain(distance[rows], 4), "y": plain(y, digits)}


def choose_rows(values: Floats) -> NDArray[np.intp]:
    """Return at most MAX_POINTS rows of curves (m, k): first, last, and all peaks and dips.

    A peak between two waypoints is what refuses a path; it must not be left out.
    """
    m = len(values)
    if m <= MAX_POINTS:
        return np.arange(m)
    edges = np.linspace(0, m, MAX_POINTS // 2).astype(int)
    high = np.nan_to_num(values, nan=-1e9).max(axis=1)
    low = np.nan_to_num(values, nan=1e9).min(axis=1)
    chosen = [
        first + int(pick)
        for first, end in itertools.pairwise(edges)
        for pick in (np.argmax(high[first:end]), np.argmin(low[first:end]))
    ]
    return np.unique([0, *chosen, m - 1])
