# SPDX-License-Identifier: Apache-2.0
"""The limits along a path: how much of each is used, by which wheel, and where it is broken."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import find_column, numbers_of
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus
from rover_physics.traversability.classification import find_wheel
from rover_physics.traversability.verdict import Verdict
from rover_planner.viewer.state.reasons.limits import GROUND, Limit, list_limits


class Use(IntEnum):
    """What is known of a limit at a pose."""

    KEPT = 0
    """It is kept."""
    BROKEN = 1
    """It is broken."""
    EXEMPT = 2
    """It does not count, because a wheel rolls off an edge."""
    UNKNOWN = 3
    """The rover does not settle there."""


@dataclass(frozen=True, eq=False)
class PathRows:
    """The poses of a path at which the model was asked, m of them, in the order of the path."""

    distance: Floats
    """(m,) horizontal distance since the start [m]."""
    time: Floats
    """(m,) time since the start [s]; where the rover does not settle, and so has no time, that of
    the last waypoint before at which it does, 0 without one."""
    waypoint: NDArray[np.int64]
    """(m,) index of the waypoint, or of the next one for a pose in between."""
    is_between: NDArray[np.bool_]
    """(m,) True for poses between waypoints."""
    row: NDArray[np.int64]
    """(m,) row in the prediction, or in its `between`."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One limit along the path; arrays (m,) as in `PathRows`."""

    limit: Limit
    """The limit."""
    values: Floats
    """The value nearest to the limit, in the limit's unit; NaN for none."""
    used: Floats
    """Share of the limit that is used: 1 is at the limit; NaN where it is not known."""
    wheel: NDArray[np.int64]
    """Index of the wheel concerned, -1 for none."""
    use: NDArray[np.int8]
    """One of `Use`."""

    def worst_until(self, rows: int) -> int:
        """Return the worst of the first rows: one that breaks the limit, else the most used one.

        -1 if nothing is known there.
        """
        counts = self.use[:rows] <= Use.BROKEN
        used = np.where(counts & ~np.isnan(self.used[:rows]), self.used[:rows], -np.inf)
        used = np.where(self.use[:rows] == Use.BROKEN, np.fmax(used, 1.0 + 1e-9), used)
        return int(np.argmax(used)) if used.size and used.max() > -np.inf else -1


def along_rows(rows: PathRows, prediction: PathPrediction, name: str) -> Floats:
    """Return the values (m, ...) of a field of a prediction at the rows."""
    values = getattr(prediction, name)[rows.row * ~rows.is_between]
    if rows.is_between.any() and prediction.between is not None:
        values = values.copy()
        between = getattr(prediction.between, name)
        values[rows.is_between] = between[rows.row[rows.is_between]]
    return np.asarray(values)


@dataclass(frozen=True, eq=False)
class PathLimits:
    """All limits along a path up to its first failure."""

    rows: PathRows
    """The poses."""
    lanes: tuple[Lane, ...]
    """The limits, in the order in which they become reasons."""
    path_length: float
    """Length of the whole path, also beyond the failure [m]."""

    @property
    def end(self) -> float:
        """Distance of the last pose [m]."""
        return float(self.rows.distance[-1])

    def lane(self, code: str) -> Lane:
        """Return the lane of a code of a verdict; that of the ground for other codes."""
        found = {lane.limit.code: lane for lane in self.lanes}
        return found.get(code, found[GROUND])


def find_path_limits(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> PathLimits:
    """Return how a prediction uses the limits, up to and including the first failure.

    Args:
        rover: The rover.
        prediction: The prediction of the path.
        verdict: The verdict on it; it also knows of refusals that no limit of a pose explains,
            such as entrapment and the worst case of an uncertain map.
    """
    length = float(prediction.distance[-1])
    if verdict.first_failure >= 0:
        prediction = prediction.cut(verdict.first_failure + 1)
    rows, order = _merge_rows(prediction)
    limits = list_limits(rover, prediction)
    parts = [prediction]
    if prediction.between is not None and len(prediction.between.poses):
        parts.append(prediction.between)
    status = np.concatenate([part.status for part in parts])[order]
    lanes = [_ground_lane(limits[GROUND], status)]
    for code, limit in limits.items():
        if code != GROUND:
            lanes.append(_lane(rover, limit, parts, order))
            lanes[-1].use[status != PoseStatus.SETTLED] = Use.UNKNOWN
    found_limits = PathLimits(rows, tuple(lanes), length)
    _add_refusals(found_limits, verdict)
    return found_limits


def _merge_rows(prediction: PathPrediction) -> tuple[PathRows, NDArray[np.intp]]:
    """Return the poses in the order of the path, and their order among waypoints, then others."""
    n, between = len(prediction.poses), prediction.between
    place, row = np.arange(n, dtype=float), np.arange(n)
    waypoint = row
    if between is not None and len(between.poses):
        place = np.concatenate([place, _places(prediction.poses, between)])
        row = np.concatenate([row, np.arange(len(between.poses))])
        waypoint = np.concatenate([waypoint, between.waypoint])
    order = np.argsort(place, kind="stable")
    along = place[order]
    rows = PathRows(
        np.interp(along, np.arange(n), prediction.distance),
        np.interp(along, np.arange(n), _hold_known(prediction.time)),
        waypoint[order],
        order >= n,
        row[order],
    )
    return rows, order


def _hold_known(times: Floats) -> Floats:
    """Return times (n,) [s], ascending, with the last known one, or 0, in place of each NaN."""
    return np.maximum.accumulate(np.where(np.isnan(times), 0.0, times))


def _places(poses: Floats, between: PathPrediction) -> Floats:
    """Return the places (k,) of poses between waypoints: 2.5 is half-way from 2 to 3."""
    after = np.clip(between.waypoint, 1, max(len(poses) - 1, 1))
    after = np.minimum(after, len(poses) - 1)
    before = np.maximum(after - 1, 0)
    step, gone = poses[after] - poses[before], between.poses - poses[before]
    way = np.hypot(step[:, 0], step[:, 1])
    turns = way < 1e-9
    whole = np.where(turns, np.abs(step[:, 2]), way)
    part = np.where(turns, np.abs(gone[:, 2]), np.hypot(gone[:, 0], gone[:, 1]))
    return np.asarray(before + np.clip(part / np.maximum(whole, 1e-12), 1e-6, 1.0 - 1e-6))


def _ground_lane(limit: Limit, status: NDArray[np.int8]) -> Lane:
    """Return the lane of poses at which the rover cannot be judged at all."""
    m = len(status)
    stands = status == PoseStatus.SETTLED
    use = np.where(stands, Use.KEPT, Use.BROKEN).astype(np.int8)
    return Lane(limit, np.full(m, np.nan), np.where(stands, 0.0, np.nan), np.full(m, -1), use)


def _lane(
    rover: Rover, limit: Limit, parts: list[PathPrediction], order: NDArray[np.intp]
) -> Lane:
    """Return the lane of a limit at the waypoints and at the other poses."""
    columns = [_read_limit(rover, limit, part) for part in parts]
    joined = (np.concatenate(column)[order] for column in zip(*columns, strict=True))
    values, used, wheel, exempt = joined
    use = np.where(used > 1.0, Use.BROKEN, Use.KEPT)
    use = np.where(exempt, Use.EXEMPT, use).astype(np.int8)
    return Lane(limit, limit.factor * values, used, wheel, use)


def _read_limit(rover: Rover, limit: Limit, part: PathPrediction) -> tuple[NDArray[Any], ...]:
    """Return value, use, wheel and exemption (n,) of a limit; those of its row that is used most.

    The value is NaN if the limit is no number, the wheel -1 for none.
    """
    uses = find_uses(limits_of(rover, part.policy), part.results)
    rows = np.array([k for k, row in enumerate(uses.limits.rows) if row.code == limit.code])
    every = np.arange(len(part.poses))
    asked = np.where(np.isnan(uses.use[:, rows]), -np.inf, uses.use[:, rows])
    decides = rows[asked.argmax(axis=1)]
    used, element = uses.use[every, decides], uses.element[every, decides]
    values = np.full(len(every), np.nan)
    if limit.bound is not None:
        column = find_column(uses.limits.rows[rows[0]].reads)[0]
        values = numbers_of(part.results)[every, column + np.maximum(element, 0)]
    wheel = np.array([find_wheel(part, uses, i, int(k)) for i, k in enumerate(decides)], np.int64)
    rests = bool(uses.limits.records["rests_in_a_fall"][rows].all())
    return values, used, wheel, np.asarray(part.falling.any(axis=1) & rests)


def _add_refusals(limits: PathLimits, verdict: Verdict) -> None:
    """Mark refusals of the verdict that no lane shows at their waypoints."""
    rows = limits.rows
    for waypoint in np.unique(rows.waypoint).tolist():
        code = verdict.codes[waypoint]
        if not code:
            continue
        lane = limits.lane(code)
        here = rows.waypoint == waypoint
        if not np.any(lane.use[here] == Use.BROKEN):
            lane.use[here & ~rows.is_between] = Use.BROKEN
