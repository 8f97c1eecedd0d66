# SPDX-License-Identifier: Apache-2.0
"""The quasi-static model along paths: poses in, `PathPrediction` out.

A path can be swept up to its first failure. It is then swept in blocks, each longer than the one
before; rows that may break a limit are found by a kernel that errs on the safe side, and only if
there is one is the path so far held against all limits. A long path can be swept in parts, so that
the memory is that of a part.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import PoseError
from rover_physics.numerics.arrays import view_read_only
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.plausible import MAX_COORDINATE
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.crossing import climb_faces, find_crossings
from rover_physics.prediction.drops import Drops, find_drops, find_suspects
from rover_physics.prediction.halving import AtFailure
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import (
    Crossings,
    add_up,
    distances_between,
    find_remaining_jumps,
    join_crossings,
    none_held,
)
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.servo_path import climb_costs, write_servo_path
from rover_physics.prediction.slots import stop_in_slots
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import (
    join_results,
    place_results,
    select_results,
    unwritten_results,
)
from rover_physics.results.uses import RoverLimits, find_uses
from rover_physics.rover.steering_joints import swing_radius

FIRST_BLOCK = 32
"""Number of waypoints of a path that are evaluated first."""
MIN_GROWTH, MAX_GROWTH = 2.0, 16.0
"""Bounds of the length of a block over that of the block before."""
BLOCK_TIME = 3e-3
"""Time [s] that a block aims at, about ten times what a block costs beside its poses. What is
found does not depend on the blocks."""
PART = 8192
"""Number of waypoints that are swept at a time in parts."""

Sums = tuple[float, float, float]
"""Distance [m], time [s] and energy [J] since the start of a path."""
NO_SUMS = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SweptPath:
    """A prediction along a path with the poses between its waypoints."""

    prediction: PathPrediction
    """The prediction."""
    crossings: Crossings
    """Poses between the waypoints."""

    def cut(self, waypoints: int) -> "SweptPath":
        """Return what is about the first waypoints."""
        crossings = self.crossings.select(self.crossings.waypoint < waypoints)
        return SweptPath(self.prediction.cut(waypoints), crossings)


@dataclass(frozen=True, eq=False)
class PathPart:
    """The prediction of consecutive waypoints of a path, as that of the whole path has them."""

    start: int
    """Index of its first waypoint; those of the prediction count from there."""
    context: int
    """Number of waypoints at its beginning that earlier parts have."""
    prediction: PathPrediction
    """The prediction, with `between`."""


def predict_paths(
    model: PackedModel, paths: Sequence[np.ndarray], stop_at_failure: bool
) -> list[SweptPath]:
    """Sweep several paths at once, each in full or up to its first failure.

    Args:
        model: The rover on its ground, with options.
        paths: Poses of each path, as `check_poses` returns them.
        stop_at_failure: Whether a path ends with the first waypoint that fails; up to there its
            prediction is that of the whole path.
    """
    started = [_StartedPath(model, poses, stop_at_failure) for poses in paths]
    going, block = started, FIRST_BLOCK if stop_at_failure else max(map(len, paths), default=0)
    cost = model.relative_cost(sum(map(len, paths)))
    with limit_threads(cost):  # set once, not per round
        while going:
            check_interruption()
            began = time.perf_counter()
            _evaluate_block(model, going, block)
            for on in {path.searches_on for path in going}:
                some = [path for path in going if path.searches_on == on]
                _search_crossings(model, some, AtFailure.SEARCH_ON if on else AtFailure.LEAVE_REST)
            for path in going:
                check_interruption()
                path.look_for_failure()
            going = [path for path in going if path.swept is None]
            growth = BLOCK_TIME / max(time.perf_counter() - began, 1e-9)
            block = round(block * min(max(growth, MIN_GROWTH), MAX_GROWTH))
    return [path.swept for path in started if path.swept is not None]


def predict_in_parts(model: PackedModel, path: np.ndarray) -> Iterator[PathPart]:
    """Sweep a path (n, 3), as `check_poses` returns it, part by part.

    A part ends before wheels whose fall depends on poses that are not yet swept. The next one
    begins before its end, at a waypoint where no wheel rolls off an edge, on servos by the way
    within which drift counts.
    """
    motions = motions_of(model, path)
    start, done, size, sums = 0, 0, PART, NO_SUMS
    while done < len(path):
        check_interruption()
        end = min(start + size, len(path))
        here = path[start:end]
        with limit_threads(model.relative_cost(len(here))):
            results = model.evaluate(here, motions=motions[start:end])
            crossings = find_crossings(model, here, results)
        swept, drops = make_prediction(model, here, results, crossings, sums)
        decided = end - start if end == len(path) else drops.decided
        if start + decided > done:
            yield PathPart(start, done - start, swept.prediction.cut(decided))
            done = start + decided
        restart = _find_restart(model, here, drops)
        if restart:
            first = slice(restart + 1)
            results = swept.prediction.results[first]
            sums = _sum_up(model, here[first], results, swept.crossings, sums)
            start, size = start + restart, PART
        else:
            size *= 2  # no waypoint to begin from: the next part is longer


def _find_restart(model: PackedModel, poses: np.ndarray, drops: Drops) -> int:
    """Return the last waypoint of a part from which what is not decided follows; 0 for none."""
    starts = np.flatnonzero(drops.starts)
    if model.on_servos:
        way = np.append(0.0, np.cumsum(distances_between(swing_radius(model.rover), poses)))
        last = way[min(drops.decided, len(way) - 1)]
        starts = starts[way[starts] <= last - model.rover.wheelbase]
    return int(starts[-1]) if len(starts) else 0


@quiet
def predict_steered(
    model: PackedModel, poses: ArrayLike, motion: np.ndarray, angles: np.ndarray
) -> PathPrediction:
    """Predict the rover at the poses of a short path with measured steering angles.

    Args:
        model: The model.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link, map frame.
        motion: (3,) motion of base_link on the path, vx, vy [m/s] and yaw rate [rad/s], body
            frame.
        angles: (6,) steering angles of the wheels [rad], which need not fit the motion.

    Raises:
        PoseError: As `judge_path`.
    """
    places, steered = check_poses(poses), model.hold_steering(angles)
    results = steered.evaluate(places, motions=np.tile(motion, (len(places), 1)))
    crossings = find_crossings(steered, places, results)
    return make_prediction(model, places, results, crossings)[0].prediction


def predict_way_back(model: PackedModel, swept: SweptPath, waypoints: slice) -> PathPrediction:
    """Predict the way back over waypoints of a path on ground without soil.

    On Coulomb ground the forces at rest are the same in both directions. Only faces differ: a
    wheel that dropped off an edge on the way in climbs it on the way back. Only these climbs are
    evaluated.

    Args:
        model: The model of the way back, on ground without soils: that of the path, driven the
            other way.
        swept: The path.
        waypoints: The waypoints of the way back, in the order of the way in.

    Returns:
        The prediction, as a sweep over the reversed poses gives it, apart from rounding. `power`
        is that of the way in.
    """
    first, end = waypoints.start, waypoints.stop
    n = end - first
    poses = np.ascontiguousarray(swept.prediction.poses[first:end][::-1])
    results = _reverse(select_results(swept.prediction.results, np.arange(first, end)[::-1]))
    crossings = swept.crossings.select(~swept.crossings.climbing).between(first, end - 1)
    crossings = crossings.reversed(n)
    _reverse(crossings.results)
    path = Crossings(np.arange(float(n)), np.arange(n) + 1, none_held(n), poses, results)
    path, order = join_crossings([path, crossings]), crossings.order_among(n)
    pairs = np.empty((len(order), 2), np.int64)
    count = find_remaining_jumps(model.records, path.views, order, n, pairs)
    if count:
        climbs = climb_faces(model, path, pairs[:count])
        crossings = join_crossings([crossings, climbs]).in_order()
    return make_prediction(model, poses, results, crossings)[0].prediction


def _reverse(results: Any) -> Any:
    """Reverse the motions in RESULTs (n,) of the way in, and return them."""
    results["motion"] *= -1.0
    results["wheel_speed"] *= -1.0
    return results


def predict_poses(model: PackedModel, places: np.ndarray, motions: np.ndarray) -> PathPrediction:
    """Return the prediction of single poses (n, 3) that form no path, with motions (n, 3)."""
    results = model.evaluate(places, motions=motions)
    return _collect(model, places, results, np.arange(len(places)))


class _StartedPath:
    """A path of which the first waypoints are swept."""

    def __init__(self, model: PackedModel, poses: np.ndarray, stops: bool):
        self._model, self.poses, self._stops = model, poses, stops
        self.motions = motions_of(model, poses)
        self.results = unwritten_results(len(poses))
        """(n,) RESULT of each waypoint; the first `evaluated` are written."""
        self.evaluated = 0
        self.searched = 0
        """Number of waypoints up to which the crossings are known."""
        self.swept: SweptPath | None = None
        """The result once it is known."""
        self.searches_on = not stops
        """True once it fails where later poses decide how: nothing is left out any more."""
        self._suspicious = False
        self._crossings: list[Crossings] = []

    def block(self, size: int) -> slice:
        """Return the waypoints to evaluate next; none while evaluated ones are not searched."""
        if self.searched < self.evaluated:
            return slice(self.evaluated, self.evaluated)
        return slice(self.evaluated, min(self.evaluated + size, len(self.poses)))

    def stretch(self) -> slice:
        """Return the waypoints between which to search crossings next, up to a sure failure."""
        end = self.evaluated
        if not self.searches_on:
            news = self.results[self.searched : self.evaluated]
            suspect, failure = self._find_suspects(news)
            end = self.evaluated if failure < 0 else self.searched + failure + 1
            self._suspicious |= 0 <= suspect < end - self.searched
        first = max(self.searched - 1, 0)
        self.searched = end
        return slice(first, end)

    def take_crossings(self, crossings: Crossings) -> None:
        """Keep the crossings of the last stretch, whose places count from the path's start.

        What is beyond a sure failure was not searched in full, and is searched again if it counts.
        """
        if not self.searches_on:
            suspect, failure = self._find_suspects(crossings.results)
            self._suspicious |= suspect >= 0
            if failure >= 0:
                self.searched = int(crossings.waypoint[failure]) + 1
                crossings = crossings.select(crossings.waypoint < self.searched)
        self._crossings.append(crossings)

    def _find_suspects(self, results: Any) -> tuple[int, int]:
        records, limits = self._model.records, self._model.limits.records
        found = find_suspects(records, limits, view_read_only(results))
        return found[0], found[1]

    def look_for_failure(self) -> None:
        """Complete the path if all of it is swept, or if a waypoint that is swept fails."""
        end, crossings = self.searched, join_crossings(self._crossings)
        self._crossings = [crossings]
        complete = end == len(self.poses)
        here, results = self.poses[:end], self.results[:end]
        if complete and not self._stops:
            self.swept = make_prediction(self._model, here, results, crossings)[0]
            return
        if not (complete or self._suspicious):
            if not len(crossings.place):
                return
            drops = find_drops(self._model.records, here, results, crossings)
            if not drops.heights.max() > self._model.rover.limits.wheel_drop:
                return
        swept, drops = make_prediction(self._model, here, results, crossings)
        failure = find_first_failure(self._model.limits, swept.prediction)
        if complete and failure < 0:
            self.swept = swept
        elif failure >= 0 and (complete or failure < drops.decided):
            self.swept = swept.cut(failure + 1)
        if failure >= 0:
            self.searches_on = self._suspicious = True


def find_first_failure(limits: RoverLimits, prediction: PathPrediction) -> int:
    """Return the first waypoint at or just before which a limit is broken; -1 for none."""
    first = len(prediction.poses)
    for part in (prediction, prediction.between):
        if part is not None and len(part.poses):
            broken = find_uses(limits, part.results).find_first() >= 0
            first = min(first, int(part.waypoint[broken].min(initial=first)))
    return first if first < len(prediction.poses) else -1


def _evaluate_block(model: PackedModel, paths: Sequence[_StartedPath], size: int) -> None:
    """Evaluate the next waypoints of all paths together."""
    blocks = [path.block(size) for path in paths]
    pairs = list(zip(paths, blocks, strict=True))
    at = np.concatenate([path.poses[block] for path, block in pairs])
    if not len(at):
        return
    motions = np.concatenate([path.motions[block] for path, block in pairs])
    results, first = model.evaluate(at, motions=motions), 0
    for path, block in pairs:
        end = first + block.stop - block.start
        place_results(results[first:end], path.results, block)
        path.evaluated, first = block.stop, end


def _search_crossings(
    model: PackedModel, paths: Sequence[_StartedPath], at_failure: AtFailure
) -> None:
    """Search the crossings of the next stretches of all paths together."""
    stretches = [path.stretch() for path in paths]
    pairs = list(zip(paths, stretches, strict=True))
    ends = np.cumsum([stretch.stop - stretch.start for stretch in stretches])
    poses = np.concatenate([path.poses[stretch] for path, stretch in pairs])
    results = join_results([path.results[stretch] for path, stretch in pairs])
    crossings = find_crossings(model, poses, results, joined_paths(ends), at_failure)
    for (path, stretch), first, end in zip(pairs, [0, *ends[:-1]], ends, strict=True):
        path.take_crossings(crossings.between(first, end, stretch.start))


def joined_paths(ends: np.ndarray) -> np.ndarray:
    """Return (n - 1,) False where a path ends and the next begins.

    `ends` (k,) are the numbers of waypoints up to the end of each path.
    """
    joined = np.ones(ends[-1] - 1, bool)
    joined[ends[:-1] - 1] = False
    return joined


def make_prediction(
    model: PackedModel,
    poses: np.ndarray,
    results: Any,
    crossings: Crossings,
    start: Sums = NO_SUMS,
) -> tuple[SweptPath, Drops]:
    """Return the prediction of one path from its results, and its drops.

    What the path decides is written into the results. Distance, time and energy at the first pose
    are `start`.
    """
    drops = find_drops(model.records, poses, results, crossings)
    if model.on_servos:
        results = results.copy()
        crossings = crossings._replace(results=crossings.results.copy())
        write_servo_path(model, poses, results, crossings)
    else:
        stop_in_slots(results, crossings)
    between = crossings.results
    results["wheel_drop"] = drops.heights
    results["falling"], between["falling"] = drops.at_waypoints, drops.between
    _write_sums(model, crossings.poses, between, NO_SUMS)
    _write_sums(model, poses, results, start)
    if model.on_servos:
        time, energy = climb_costs(poses, results, crossings).T
        results["time"] += time
        results["energy"] += energy
    at_crossings = _collect(model, crossings.poses, between, crossings.waypoint)
    prediction = _collect(model, poses, results, np.arange(len(poses)), at_crossings)
    return SweptPath(prediction, crossings), drops


def check_poses(poses: ArrayLike) -> np.ndarray:
    """Return a copy of poses as a float array (n, 3).

    Raises:
        PoseError: Wrong shape or type, no pose, values that are not finite or beyond
            MAX_COORDINATE.
    """
    try:
        array = np.array(poses, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise PoseError(f"poses are not numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise PoseError(f"poses have shape {array.shape}; it must be (n, 3): x, y, yaw, n >= 1")
    plausible = np.abs(array) <= MAX_COORDINATE  # False for NaN
    if not plausible.all():
        row, column = np.argwhere(~plausible)[0]
        name, value = ["x", "y", "yaw"][column], array[row, column]
        most = f"{MAX_COORDINATE:g} {'rad' if name == 'yaw' else 'm'}"
        raise PoseError(f"{name} of pose {row} is {value}; poses must be finite and within {most}")
    return array


def _sum_up(
    model: PackedModel, poses: np.ndarray, results: Any, crossings: Crossings, start: Sums
) -> Sums:
    """Return distance [m], time [s] and energy [J] at the last pose from those at the first."""
    if model.on_servos:
        before = crossings.select(crossings.waypoint < len(poses))
        time, energy = climb_costs(poses, results, before)[-1]
        start = (start[0], start[1] + time, start[2] + energy)
    path, sums = (view_read_only(poses), view_read_only(results)), np.empty((3, len(poses)))
    return add_up(model.records, *path, start, sums)


def _write_sums(model: PackedModel, poses: np.ndarray, results: Any, start: Sums) -> None:
    """Write distance, time and energy at poses (n, 3) into their RESULTs."""
    sums = np.empty((3, len(poses)))
    add_up(model.records, view_read_only(poses), view_read_only(results), start, sums)
    results["distance"], results["time"], results["energy"] = sums


def _collect(
    model: PackedModel,
    poses: np.ndarray,
    results: Any,
    waypoint: np.ndarray,
    between: PathPrediction | None = None,
) -> PathPrediction:
    return PathPrediction(
        poses=poses,
        results=results,
        waypoint=waypoint,
        policy=model.options.policy,
        control_margin=float(model.settings["control_margin"]),
        between=between,
    )
