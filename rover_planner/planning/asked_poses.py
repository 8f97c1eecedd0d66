# SPDX-License-Identifier: Apache-2.0
"""The poses at which the model was asked along a path: its waypoints and those between them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import join_results, select_results


@dataclass(frozen=True, eq=False)
class AskedPoses:
    """The poses of a path at which the model was asked, m of them, in the order of the path."""

    prediction: PathPrediction
    """Of all of them; its `waypoint` is the next one for a pose in between, its energy what was
    spent up to there."""
    is_between: NDArray[np.bool_]
    """(m,) True for poses between waypoints."""
    place: Floats
    """(m,) places along the path: 2.5 is half-way from waypoint 2 to 3."""
    distance: Floats
    """(m,) horizontal distance since the start [m]."""
    time: Floats
    """(m,) time since the start [s]; where the rover does not settle, and so has no time, that of
    the last waypoint before at which it does, 0 without one."""


def merge_poses(prediction: PathPrediction) -> AskedPoses:
    """Return the waypoints of a prediction and the poses between, in the order of the path."""
    n, between = len(prediction.poses), prediction.between
    parts, place = [prediction], np.arange(n, dtype=float)
    if between is not None:
        parts.append(between)
        place = np.concatenate([place, _places(prediction.poses, between)])
    order = np.argsort(place, kind="stable")
    along = place[order]
    driven = {
        name: np.interp(along, np.arange(n), _fill_unknown(getattr(prediction, name)))
        for name in ("distance", "time", "energy")
    }
    merged = replace(
        prediction,
        poses=np.concatenate([part.poses for part in parts])[order],
        results=select_results(join_results([part.results for part in parts]), order),
        waypoint=np.concatenate([part.waypoint for part in parts])[order],
        between=None,
        bounds=None,
    )
    known = merged.change(**driven)
    return AskedPoses(known, order >= n, along, driven["distance"], driven["time"])


def _fill_unknown(values: Floats) -> Floats:
    """Return values (n,), ascending, with the last known one, or 0, in place of each NaN."""
    return np.maximum.accumulate(np.where(np.isnan(values), 0.0, values))


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
