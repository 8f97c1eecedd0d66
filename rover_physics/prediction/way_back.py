# SPDX-License-Identifier: Apache-2.0
"""The way back along a swept path on ground without soil, from the results of the way in.

On Coulomb ground the forces at rest are the same in both directions. Only faces differ: a wheel
that dropped off an edge on the way in climbs it on the way back.
"""

from typing import Any

import numpy as np

from rover_physics.prediction.crossing import (
    Crossings,
    climb_faces,
    join_crossings,
    limits_of,
)
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import find_remaining_jumps
from rover_physics.prediction.sweep import SweptPath, evaluator, make_prediction, wheels_of
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import select_results
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain


def predict_way_back(
    rover: Rover, terrain: Terrain, model: PackedModel, swept: SweptPath, waypoints: slice
) -> PathPrediction:
    """Predict the way back over waypoints of a path; only climbs of faces are evaluated.

    Args:
        rover: The rover.
        terrain: The ground, without soils.
        model: The model of the way back: the options of the path, driven the other way.
        swept: The path.
        waypoints: The waypoints of the way back, in the order of the way in.

    Returns:
        The prediction, as a sweep over the reversed poses gives it, apart from rounding. `power`
        and `energy` are those of the way in.
    """
    first, end = waypoints.start, waypoints.stop
    n = end - first
    poses = np.ascontiguousarray(swept.prediction.poses[first:end][::-1])
    results = _reverse(select_results(swept.results, np.arange(first, end)[::-1]))
    rest = swept.crossings.select(~swept.crossings.climbing).between(first, end - 1)
    rest = rest.reversed(n)
    _reverse(rest.results)
    path = Crossings(np.arange(float(n)), np.arange(n) + 1, np.zeros(n, bool), poses, results)
    pairs = np.empty((n + len(rest.place), 2), np.int64)
    limits = limits_of(wheels_of(model))
    pairs = pairs[: find_remaining_jumps(path.points, rest.points, limits, pairs)]
    crossings = rest
    if len(pairs):
        ends = _pick(path, rest, pairs.ravel())
        rows = np.arange(len(ends.place)).reshape(-1, 2)
        climbs = climb_faces(terrain, rover.wheel.radius, ends, rows, evaluator(model))
        crossings = join_crossings([rest, climbs]).in_order()
    return make_prediction(model, poses, results, crossings)[0].prediction


def _reverse(results: Any) -> Any:
    """Reverse the motions in RESULTs (n,) of the way in, and return them."""
    results["motion"] *= -1.0
    results["wheel_speed"] *= -1.0
    return results


def _pick(path: Crossings, rest: Crossings, rows: np.ndarray) -> Crossings:
    """Return the rows of path and rest, numbered one after the other."""
    n = len(path.place)
    on_path = rows < n
    parts = [path.select(rows[on_path]), rest.select(rows[~on_path] - n)]
    order = np.empty(len(rows), np.intp)
    order[np.flatnonzero(on_path)] = np.arange(on_path.sum())
    order[np.flatnonzero(~on_path)] = on_path.sum() + np.arange((~on_path).sum())
    return join_crossings(parts).select(order)
