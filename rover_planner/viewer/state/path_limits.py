# SPDX-License-Identifier: Apache-2.0
"""The limits along a path: how much of each is used, by which wheel, and the worst so far."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import (
    find_column,
    join_results,
    numbers_of,
    select_results,
)
from rover_physics.results.uses import ABOVE, Uses, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.traversability.classification import find_wheel
from rover_physics.traversability.verdict import Verdict
from rover_planner.viewer.state.limits import GROUND, ShownLimit, list_limits

NOT_ON_THE_BOARD = (GROUND, "suspension", "wheel_lift")
"""Codes of limits whose worst use the board does not list."""


@dataclass(frozen=True, eq=False)
class AskedPoses:
    """The poses of a path at which the model was asked, m of them, in the order of the path."""

    prediction: PathPrediction
    """Of all of them; its `waypoint` is the next one for a pose in between."""
    is_between: NDArray[np.bool_]
    """(m,) True for poses between waypoints."""
    distance: Floats
    """(m,) horizontal distance since the start [m]."""
    time: Floats
    """(m,) time since the start [s]; where the rover does not settle, and so has no time, that of
    the last waypoint before at which it does, 0 without one."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One limit along the path; arrays (m,) as in `AskedPoses`."""

    limit: ShownLimit
    """The limit."""
    values: Floats
    """The value nearest to the limit, in the limit's unit; NaN for none."""
    used: Floats
    """Use of the limit: 1 at the limit, above 1 where it is broken, NaN where it does
    not count or is not known."""
    wheel: NDArray[np.int64]
    """Index of the wheel concerned, -1 for none."""

    def worst_until(self, rows: int) -> int:
        """Return the row of the first rows that uses most; -1 if nothing is known there."""
        used = np.where(np.isnan(self.used[:rows]), -np.inf, self.used[:rows])
        return int(np.argmax(used)) if used.size and used.max() > -np.inf else -1


@dataclass(frozen=True, eq=False)
class PathLimits:
    """All limits along a path up to its first failure."""

    rows: AskedPoses
    """The poses."""
    lanes: tuple[Lane, ...]
    """The limits, in the order in which they become reasons."""

    @property
    def end(self) -> float:
        """Distance of the last pose [m]."""
        return float(self.rows.distance[-1])

    def lane(self, code: str) -> Lane:
        """Return the lane of a code of a verdict; that of the ground for other codes."""
        found = {lane.limit.code: lane for lane in self.lanes}
        return found.get(code, found[GROUND])


@dataclass(frozen=True)
class WorstUse:
    """The worst use of one limit up to a time of the drive."""

    title: str
    """Short name of the limit."""
    value: str = "?"
    """The value nearest to the limit, as text."""
    bound: str = ""
    """Good values with their unit, such as "max 1.00"; empty if it is no single number."""
    used: float = 0.0
    """Use of the limit, above 1 if it is broken."""
    wheel: str = ""
    """The wheel concerned, empty for none."""

    @property
    def is_broken(self) -> bool:
        """True if the limit is broken."""
        return self.used > 1.0


def find_path_limits(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> PathLimits:
    """Return how a prediction uses the limits, up to and including the first failure.

    Args:
        rover: The rover.
        prediction: The prediction of the path.
        verdict: The verdict on it; it also knows of refusals that no limit of a pose explains,
            such as entrapment and the worst case of an uncertain map.
    """
    if verdict.first_failure >= 0:
        prediction = prediction.cut(verdict.first_failure + 1)
    rows = merge_poses(prediction)
    uses = find_uses(limits_of(rover, prediction.policy), rows.prediction.results)
    lanes = tuple(
        _make_ground_lane(limit, rows) if code == GROUND else _make_lane(limit, rows, uses)
        for code, limit in list_limits(rover, prediction).items()
    )
    found = PathLimits(rows, lanes)
    _add_refusals(found, verdict)
    return found


def merge_poses(prediction: PathPrediction) -> AskedPoses:
    """Return the waypoints of a prediction and the poses between, in the order of the path."""
    n, between = len(prediction.poses), prediction.between
    parts, place = [prediction], np.arange(n, dtype=float)
    if between is not None:
        parts.append(between)
        place = np.concatenate([place, _places(prediction.poses, between)])
    order = np.argsort(place, kind="stable")
    along = place[order]
    merged = replace(
        prediction,
        poses=np.concatenate([part.poses for part in parts])[order],
        results=select_results(join_results([part.results for part in parts]), order),
        waypoint=np.concatenate([part.waypoint for part in parts])[order],
        between=None,
        bounds=None,
    )
    return AskedPoses(
        merged,
        order >= n,
        np.interp(along, np.arange(n), prediction.distance),
        np.interp(along, np.arange(n), _hold_known(prediction.time)),
    )


def _hold_known(times: Floats) -> Floats:
    """Return times (n,) [s], ascending, with the last known one, or 0, in place of each NaN."""
    return np.maximum.accumulate(np.where(np.isnan(times), 0.0, times))


def _places(poses: Floats, between: PathPrediction) -> Floats:
    """Return the places (k,) of poses between waypoints: 2.5 is half-way from 2 to 3."""
    after = np.clip(between.waypoint, 1, max(len(poses) - 1, 1))
    after = np.minimum(after, len(poses) - 1)
    before = np.maximum(after - 1, 0)
    step, gone = poses[after] - poses[before], between.poses - poses[before]
    length = np.hypot(step[:, 0], step[:, 1])
    turns = length < 1e-9
    whole = np.where(turns, np.abs(step[:, 2]), length)
    part = np.where(turns, np.abs(gone[:, 2]), np.hypot(gone[:, 0], gone[:, 1]))
    return np.asarray(before + np.clip(part / np.maximum(whole, 1e-12), 1e-6, 1.0 - 1e-6))


def _make_ground_lane(limit: ShownLimit, rows: AskedPoses) -> Lane:
    """Return the lane of poses at which the rover cannot be judged at all."""
    m = len(rows.distance)
    used = np.where(rows.prediction.settled, 0.0, np.inf)
    return Lane(limit, np.full(m, np.nan), used, np.full(m, -1))


def _make_lane(limit: ShownLimit, rows: AskedPoses, uses: Uses) -> Lane:
    """Return the lane of a limit; of several rows of the table that which is used most counts."""
    prediction, every = rows.prediction, np.arange(len(rows.distance))
    of_limit = np.array([k for k, row in enumerate(uses.limits.rows) if row.code == limit.code])
    asked = np.where(np.isnan(uses.use[:, of_limit]), -np.inf, uses.use[:, of_limit])
    decides = of_limit[asked.argmax(axis=1)]
    used = np.where(prediction.settled, uses.use[every, decides], np.nan)
    values = np.full(len(every), np.nan)
    if limit.bound is not None:
        column = find_column(uses.limits.rows[of_limit[0]].reads)[0]
        element = np.maximum(uses.element[every, decides], 0)
        values = limit.unit.factor * numbers_of(prediction.results)[every, column + element]
    wheel = [find_wheel(prediction, uses, row, int(k)) for row, k in enumerate(decides)]
    return Lane(limit, values, used, np.array(wheel, np.int64))


def _add_refusals(limits: PathLimits, verdict: Verdict) -> None:
    """Mark refusals of the verdict that no lane shows at their waypoints."""
    rows = limits.rows
    for waypoint in np.unique(rows.prediction.waypoint).tolist():
        code = verdict.codes[waypoint]
        lane, here = limits.lane(code), rows.prediction.waypoint == waypoint
        if code and not np.any(lane.used[here] > 1.0):
            lane.used[here & ~rows.is_between] = ABOVE


def find_worst(limits: PathLimits, time: float) -> tuple[WorstUse, ...]:
    """Return the worst use of each limit with a number up to a time [s]."""
    rows = int(np.searchsorted(limits.rows.time, time + 1e-6, side="right"))
    return tuple(
        _worst(lane, lane.worst_until(rows))
        for lane in limits.lanes
        if lane.limit.code not in NOT_ON_THE_BOARD
    )


def _worst(lane: Lane, at: int) -> WorstUse:
    """Return the use at a row of a lane, -1 for none, as text."""
    limit = lane.limit
    if at < 0:
        return WorstUse(limit.title)
    value, used = float(lane.values[at]), float(lane.used[at])
    wheel = WHEELS[lane.wheel[at]] if lane.wheel[at] >= 0 and value > 0.0 else ""
    if limit.bound is None:
        share = "broken" if used > 1.0 else f"{100.0 * used:.0f} %"
        return WorstUse(limit.title, share, "", used, wheel)
    word = "min" if limit.is_lowest else "max"
    bound = f"{word} {limit.write(limit.bound)} {limit.unit.name}".strip()
    return WorstUse(limit.title, limit.write(value), bound, used, wheel)
