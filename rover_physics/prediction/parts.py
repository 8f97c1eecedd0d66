# SPDX-License-Identifier: Apache-2.0
"""Sweeps of long paths in parts: the memory is that of a part, whatever the length of the path."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.crossing import find_crossings
from rover_physics.prediction.evaluation import effort
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_motion import path_motions
from rover_physics.prediction.sweep import (
    NO_SUMS,
    check_poses,
    evaluator,
    make_prediction,
    sum_up,
    wheels_of,
)
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain

PART = 8192
"""Number of waypoints that are swept at a time."""


@dataclass(frozen=True, eq=False)
class Part:
    """The prediction of consecutive waypoints of a path, as that of the whole path has them."""

    first: int
    """Index of the first waypoint that no earlier part has."""
    context: int
    """Number of waypoints at the beginning of the prediction that earlier parts have."""
    prediction: PathPrediction
    """The waypoints from `first - context` on, with `between`. Its indices of waypoints count from
    there."""


def predict_in_parts(
    rover: Rover, terrain: Terrain, poses: ArrayLike, options: SweepOptions = DEFAULT_OPTIONS
) -> Iterator[Part]:
    """Sweep a path part by part; arguments and errors as `judge_path`.

    A part ends before wheels whose fall depends on poses that are not yet swept. The next one
    begins before it, at a waypoint where no wheel falls.
    """
    model, path = pack_model(rover, terrain, options), check_poses(poses)
    motions = path_motions(model, path)
    start, done, size, sums = 0, 0, PART, NO_SUMS
    while done < len(path):
        check_interruption()
        end = min(start + size, len(path))
        here = path[start:end]
        results, crossings = _evaluate(terrain, model, here, motions[start:end])
        swept, falls = make_prediction(model, here, results, crossings, sums)
        decided = end - start if end == len(path) else falls.decided
        if start + decided > done:
            yield Part(done, done - start, swept.prediction.cut(decided))
            done = start + decided
        if falls.restart:
            reached = slice(falls.restart + 1)
            sums = sum_up(model, here[reached], results[reached], crossings, sums)
            start, size = start + falls.restart, PART
        else:
            size *= 2  # no waypoint to begin from: the next part is longer


def _evaluate(terrain: Terrain, model: PackedModel, poses: np.ndarray, motions: np.ndarray):
    """Return the results and crossings of waypoints."""
    evaluate = evaluator(model)
    with limit_threads(effort(model.settings, len(poses))):
        results = evaluate(poses, motions=motions)
        return results, find_crossings(terrain, wheels_of(model), poses, results, evaluate)
