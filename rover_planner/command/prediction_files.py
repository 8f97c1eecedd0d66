# SPDX-License-Identifier: Apache-2.0
"""The files of the `predict` command, poses and predictions: read, computed and written."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rover_physics.errors import RoverFileError
from rover_physics.files.npz_file import FLAGS, NUMBERS, TEXTS, NpzParts, open_npz, write_npz
from rover_physics.files.validation import errors_of, show_file
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import BOUNDED_VALUES, PathPrediction, prediction_of
from rover_physics.results.record import QUANTITIES, VIEWS
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import ClassifiedWaypoint, classify_judged
from rover_physics.traversability.judge import PartwiseJudge, judge_path, judge_poses
from rover_physics.traversability.torque_ranges import TorqueRanges, find_torque_ranges
from rover_physics.traversability.verdict import Verdict
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import (
    Assumptions,
    assume,
    read_assumptions,
    write_assumptions,
)

Shape = tuple[int, ...]

ARRAYS: dict[str, Shape] = (
    {"poses": (3,), "status": (), "settled": (), "position": (3,)}
    | {name: VIEWS[name][2] for name in ("roll", "pitch", "bogie_angle")}
    | {one.name: one.shape for one in QUANTITIES if one.is_kept}
)
"""Arrays of a prediction in the output file, under the same names: shape of a waypoint's part."""
TYPES: dict[str, tuple[str, DTypeLike]] = {
    "settled": (FLAGS, np.bool_), "falling": (FLAGS, np.bool_), "status": (NUMBERS, np.int8)
}  # fmt: skip
"""Arrays that do not hold float64: kinds of types in the file, and type when read."""
SHOWN = ("position", "wheel_centres", "distance", "time")
"""Arrays that a replay cannot do without where the rover settled."""
MAX_NUMBER = 1e9
"""Largest magnitude in `poses` and SHOWN [m, rad, s]."""
MAX_POSES = 1_000_000
"""Largest number of poses or waypoints in a file."""
MAX_IN_MEMORY = 20_000
"""Largest number of poses whose prediction is kept in memory; longer paths are written in parts,
except with classes or chances."""
BLOCK = 10_000
"""Number of reasons that are written at a time."""
MAX_REASONS = 50_000_000
"""Largest number of characters of the reasons in a file."""
ASSUMPTIONS = "assumptions"
"""Array () of a text: what the prediction was made for."""
MAX_ASSUMPTIONS = 25_000
"""Its largest number of characters."""


def read_poses(path: Path) -> NDArray[np.float64]:
    """Read `poses` (n, 3), x, y [m] and yaw [rad] of the body origin, from an .npz file.

    Raises:
        PlanningError: The file is missing or not an .npz file, has no such array of numbers, or
            one of more than MAX_POSES poses.
    """
    with errors_of(path, PlanningError), open_npz(path) as archive:
        return archive.read(
            "poses", most=3 * MAX_POSES, kinds=NUMBERS, shape=(None, 3), dtype=np.float64
        )


def read_curvature(path: Path, count: int) -> NDArray[np.float64] | None:
    """Read `curvature` (n,) [1/m] of a file of `count` poses, None if it has none.

    Raises:
        PlanningError: It is not an array of as many numbers as poses, or one of them is NaN.
    """
    with errors_of(path, PlanningError), open_npz(path) as archive:
        if "curvature" not in archive.names:
            return None
        curvature = archive.read(
            "curvature", most=count, kinds=NUMBERS, shape=(count,), dtype=np.float64
        )
        unknown = np.flatnonzero(np.isnan(curvature))
        if unknown.size:
            raise RoverFileError(
                f"curvature of pose {unknown[0]} is nan; it must be a number of 1/m, inf or -inf "
                "for a turn on the spot"
            )
        return curvature


def read_prediction(
    path: Path,
) -> tuple[PathPrediction, tuple[str, ...], Assumptions | None]:
    """Read a file of `write_prediction`, without crossings between waypoints and bounds.

    Returns:
        The prediction of n waypoints; for each the reason why it is not passable, "" if it is
        passable; and what the prediction was made for, None if the file does not tell.

    Raises:
        PlanningError: The file is missing or is not a file of predictions.
    """
    assumptions = None
    with errors_of(path, PlanningError), open_npz(path) as archive:
        reasons = archive.read("reason", most=MAX_REASONS, kinds=TEXTS, shape=(None,)).tolist()
        if not 1 <= len(reasons) <= MAX_POSES:
            raise RoverFileError(f"has {len(reasons)} reasons; it must have 1 to {MAX_POSES}")
        arrays: dict[str, Any] = {}
        for name, shape in ARRAYS.items():
            kinds, dtype = TYPES.get(name, (NUMBERS, np.float64))
            size, most = (len(reasons), *shape), len(reasons) * math.prod(shape)
            arrays[name] = archive.read(name, most=most, kinds=kinds, shape=size, dtype=dtype)
        if ASSUMPTIONS in archive.names:
            text = str(archive.read(ASSUMPTIONS, most=MAX_ASSUMPTIONS, kinds=TEXTS, shape=()))
            try:
                assumptions = read_assumptions(text)
            except PlanningError as error:
                raise PlanningError(f"{show_file(path)}: {error}") from None
    _check_numbers(path, arrays)
    poses, status = arrays.pop("poses"), arrays.pop("status")
    del arrays["settled"]
    return prediction_of(poses, status, arrays, "recorded"), tuple(reasons), assumptions


def _check_numbers(path: Path, arrays: dict[str, Any]) -> None:
    """Check that poses, and all that is shown of a settled waypoint, are finite numbers."""
    settled = arrays["settled"]
    for name in ("poses", *SHOWN):
        rows = arrays[name] if name == "poses" else arrays[name][settled]
        if not (np.abs(rows) < MAX_NUMBER).all():
            raise PlanningError(
                f"{show_file(path)}: {name} has a value that is NaN or beyond {MAX_NUMBER:g}; "
                "where the rover settled it must be a position or time"
            )


@dataclass(frozen=True, eq=False)
class AskedPoses:
    """What `predict` is asked."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground."""
    poses: Floats
    """(n, 3) x, y [m] and yaw [rad]: a path, or single poses."""
    curvature: Floats | None
    """(n,) curvatures [1/m] of single poses; None for a path."""
    options: SweepOptions
    """Torque policy, friction and more."""
    sigmas: float
    """Standard deviations to allow for where the map has them."""
    accepted_chance: float | None
    """Largest chance of failure of a path that is traversable; None: chances are not asked."""
    classes: bool
    """Whether the class of each waypoint is asked."""
    torque_ranges: bool
    """Whether the ranges of the torques are asked."""


def predict_to_file(out: Path, asked: AskedPoses, report: Callable[[str], object]) -> Verdict:
    """Predict poses and write what was asked to a file, as `write_prediction`; return the verdict.

    `report` is called with what is done next.
    """
    rover, terrain, options, sigmas = asked.rover, asked.terrain, asked.options, asked.sigmas
    path, bends, count = asked.poses, asked.curvature, len(asked.poses)
    accepted = asked.accepted_chance
    assumed, ranges, classes = assume(rover, options, sigmas), None, None
    if asked.torque_ranges:
        report("find the ranges of the torques")
        ranges = find_torque_ranges(rover, terrain, path, options, bends)
    report(f"sweep {count} poses of {rover.name} (the first run compiles the model)")
    if count > MAX_IN_MEMORY and accepted is None and not asked.classes:
        judge = PartwiseJudge(rover, terrain, path, options, curvature=bends, sigmas=sigmas)
        return _write_parts(out, count, judge, assumed, ranges)
    if bends is None:
        prediction, verdict = judge_path(
            rover, terrain, path, options, sigmas=sigmas, accepted_chance=accepted
        )
    else:
        prediction, verdict = judge_poses(
            rover, terrain, path, bends, options, sigmas=sigmas, accepted_chance=accepted
        )
    if asked.classes:
        report("classify the waypoints")
        classes = classify_judged(
            rover, terrain, prediction, verdict, options, sigmas=sigmas, curvature=bends
        )
    write_prediction(out, prediction, verdict, classes=classes, ranges=ranges, assumptions=assumed)
    return verdict


def write_prediction(
    path: Path,
    prediction: PathPrediction,
    verdict: Verdict,
    *,
    classes: Sequence[ClassifiedWaypoint] | None = None,
    ranges: TorqueRanges | None = None,
    assumptions: Assumptions | None = None,
) -> None:
    """Write a prediction and its verdict to an .npz file; the file name is not extended.

    The file has the ARRAYS, `reason` (n,) text, empty if passable, `traversable` () bool, and
    `first_failure` () int, -1 if there is none. On an uncertain map it also has `map_sigmas` ()
    and for each of BOUNDED_VALUES its `..._bounds`, with minimum and maximum in the last axis.
    If the verdict has a chance of failure, so do `failure_chance` () and `failure_chance_at` (n,).

    Args:
        path: The file; an existing one is overwritten.
        prediction: Prediction of n waypoints.
        verdict: Verdict on them.
        classes: Class of each waypoint, written as `traversability_class`, `class_constraint` and
            `class_wheel` (n,) text and `class_margin` (n,).
        ranges: Torque ranges, written as `torque_range` (n, 6, 2), minimum and maximum [N m].
        assumptions: What the prediction was made for, written as `assumptions` () text, JSON.

    Raises:
        PlanningError: The file cannot be written.
    """
    arrays = _rows_of(prediction) | _summary_of(verdict, prediction, assumptions, ranges)
    arrays["reason"] = np.array(verdict.reasons, dtype=np.str_)
    if classes is not None:
        for name in ("traversability_class", "constraint", "wheel"):
            texts = np.array([getattr(waypoint, name) for waypoint in classes], dtype=np.str_)
            arrays[name if name == "traversability_class" else f"class_{name}"] = texts
        arrays["class_margin"] = np.array([waypoint.margin for waypoint in classes])
    with errors_of(path, PlanningError):
        write_npz(path, arrays, compressed=False)


def _write_parts(
    path: Path,
    count: int,
    judge: PartwiseJudge,
    assumptions: Assumptions,
    ranges: TorqueRanges | None,
) -> Verdict:
    """Write a file as `write_prediction`, of a path that is too long to be kept in memory.

    Temporary files are made beside it. Returns the verdict on all `count` waypoints.
    """
    with errors_of(path, PlanningError), NpzParts(path.absolute().parent, count) as parts:
        for prediction in judge.parts():
            parts.add(_rows_of(prediction))
        verdict = judge.verdict()
        longest = max(1, max(map(len, verdict.reasons)))
        for first in range(0, count, BLOCK):
            block = np.array(verdict.reasons[first : first + BLOCK], f"<U{longest}")
            parts.add({"reason": block})
        parts.write(path, _summary_of(verdict, prediction, assumptions, ranges))
    return verdict


def _rows_of(prediction: PathPrediction) -> dict[str, Any]:
    """Return the arrays that have a row for each waypoint."""
    rows = {name: getattr(prediction, name) for name in ARRAYS}
    rows["steering_angle"] = np.where(
        prediction.settled[:, None], prediction.steering_angle, np.nan
    )
    if prediction.bounds is not None:
        for name in BOUNDED_VALUES:
            rows[f"{name}_bounds"] = getattr(prediction.bounds, name)
    return rows


def _summary_of(
    verdict: Verdict,
    prediction: PathPrediction,
    assumptions: Assumptions | None,
    ranges: TorqueRanges | None,
) -> dict[str, Any]:
    """Return the arrays about the whole path, chances of failure, and torque ranges."""
    arrays: dict[str, Any] = {
        "traversable": np.array(verdict.traversable, dtype=np.bool_),
        "first_failure": np.array(verdict.first_failure, dtype=np.int64),
    }
    if assumptions is not None:
        arrays[ASSUMPTIONS] = np.array(write_assumptions(assumptions))
    if prediction.bounds is not None:
        arrays["map_sigmas"] = np.array(prediction.bounds.sigmas)
    if verdict.failure_chance_at:
        arrays["failure_chance"] = np.array(verdict.failure_chance)
        arrays["failure_chance_at"] = np.array(verdict.failure_chance_at)
    if ranges is not None:
        arrays["torque_range"] = np.stack([ranges.lowest, ranges.highest], axis=-1)
    return arrays
