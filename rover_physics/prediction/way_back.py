# SPDX-License-Identifier: Apache-2.0
"""The way back along a swept path on ground without soil, from the results of the way in.

On Coulomb ground the forces at rest are the same in both directions. Only faces differ: a wheel
that dropped off an edge on the way in climbs it on the way back.
"""

from typing import Any

import numpy as np

from rover_physics.prediction.crossing import climb_faces
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_kernels import (
    Crossings,
    find_remaining_jumps,
    join_crossings,
    none_held,
)
from rover_physics.prediction.sweep import SweptPath, make_prediction
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import select_results


def predict_way_back(model: PackedModel, swept: SweptPath, waypoints: slice) -> PathPrediction:
    """Predict the way back over waypoints of a path; only climbs of faces are evaluated.

    Args:
        model: The model of the way back, on ground without soils: that of the path, driven the
            other way.
        swept: The path.
        waypoints: The waypoints of the way back, in the order of the way in.

    Returns:
        The prediction, as a sweep over the reversed poses gives it, apart from rounding. `power`
        and `energy` are those of the way in.
    """
    first, end = waypoints.start, waypoints.stop
    n, wheels = end - first, model.wheels
    poses = np.ascontiguousarray(swept.prediction.poses[first:end][::-1])
    results = _reverse(select_results(swept.prediction.results, np.arange(first, end)[::-1]))
    crossings = swept.crossings.select(~swept.crossings.climbing).between(first, end - 1)
    crossings = crossings.reversed(n)
    _reverse(crossings.results)
    path = Crossings(np.arange(float(n)), np.arange(n) + 1, none_held(n), poses, results)
    pairs = np.empty((n + len(crossings.place), 2), np.int64)
    count = find_remaining_jumps(path.views, crossings.views, wheels, pairs)
    if count:
        ends = join_crossings([path, crossings]).select(pairs[:count].ravel())
        climbs = climb_faces(model, ends, np.arange(2 * count).reshape(-1, 2))
        crossings = join_crossings([crossings, climbs]).in_order()
    return make_prediction(model, poses, results, crossings)[0].prediction


def _reverse(results: Any) -> Any:
    """Reverse the motions in RESULTs (n,) of the way in, and return them."""
    results["motion"] *= -1.0
    results["wheel_speed"] *= -1.0
    return results
