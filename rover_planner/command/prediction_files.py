# SPDX-License-Identifier: Apache-2.0
"""Reads and writes the files of the `predict` command: poses and predictions."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rover_physics.errors import RoverFileError
from rover_physics.files.npz_file import ArrayHeader, NpzParts, open_npz, write_npz
from rover_physics.files.validation import errors_of, show_file
from rover_physics.results.path_bounds import BOUNDED_VALUES
from rover_physics.results.path_prediction import PathPrediction, prediction_of
from rover_physics.results.record import QUANTITIES
from rover_physics.traversability.verdict import Verdict
from rover_planner.errors import PlanningError
from rover_planner.planning.assumptions import Assumptions, read_assumptions, write_assumptions

if TYPE_CHECKING:
    from rover_physics.traversability.classification import ClassifiedWaypoint
    from rover_physics.traversability.torque_ranges import TorqueRanges

Shape = tuple[int, ...]

ARRAYS: dict[str, Shape] = {
    "poses": (3,),
    "status": (),
    "settled": (),
    "position": (3,),
    "roll": (),
    "pitch": (),
    "bogie_angle": (2,),
} | {one.name: one.shape for one in QUANTITIES if one.is_kept}
"""Arrays of a prediction in the output file, under the same names: shape of a waypoint's part."""
NUMBER_TYPE: tuple[DTypeLike, str, str] = (np.float64, "fiu", "numbers")
FLAGS: tuple[DTypeLike, str, str] = (np.bool_, "b", "bools")
TYPES = {"settled": FLAGS, "falling": FLAGS, "status": (np.int8, "i", "whole numbers")}
"""Arrays that do not hold numbers: type when read, kinds of types in the file, and name."""
SHOWN = ("position", "wheel_centres", "distance", "time")
"""Arrays that a replay cannot do without where the rover settled."""
MAX_NUMBER = 1e9
"""Largest magnitude in `poses` and SHOWN [m, rad, s]."""
MAX_POSES = 1_000_000
"""Largest number of poses or waypoints in a file."""
BLOCK = 10_000
"""Number of reasons that are written at a time."""
MAX_REASONS = 200_000_000
"""Largest size of the reasons in a file [bytes]."""
ASSUMPTIONS = "assumptions"
"""Array () of a text: what the prediction was made for."""
MAX_ASSUMPTIONS = 100_000
"""Its largest size [bytes]."""


def read_poses(path: Path) -> NDArray[np.float64]:
    """Read `poses` (n, 3), x, y [m] and yaw [rad] of the body origin, from an .npz file.

    Raises:
        PlanningError: The file is missing or not an .npz file, has no such array of numbers, or
            one of more than MAX_POSES poses.
    """
    with errors_of(path, PlanningError), open_npz(path) as archive:
        header = archive.read_header("poses")
        if header.dtype.kind not in "fiu":
            raise RoverFileError(f"poses are of type {header.dtype}; they must be numbers")
        if len(header.shape) != 2 or header.shape[1] != 3 or header.shape[0] == 0:
            raise RoverFileError(
                f"poses have shape {header.shape}; they must be (n, 3): x, y, yaw"
            )
        _check_count("poses", header.shape[0])
        return archive.read("poses", np.float64, most=MAX_POSES * 24)


def read_curvature(path: Path, count: int) -> NDArray[np.float64] | None:
    """Read `curvature` (n,) [1/m] of a file of `count` poses, None if it has none.

    Raises:
        PlanningError: It is not an array of as many numbers as poses, or one of them is NaN.
    """
    with errors_of(path, PlanningError), open_npz(path) as archive:
        if "curvature" not in archive.names:
            return None
        header = archive.read_header("curvature")
        if header.dtype.kind not in "fiu" or header.shape != (count,):
            raise RoverFileError(
                f"curvature is of type {header.dtype} and shape {header.shape}; it must be "
                f"numbers ({count},), one for each pose"
            )
        curvature = archive.read("curvature", np.float64, most=MAX_POSES * 8)
        unknown = np.flatnonzero(np.isnan(curvature))
        if unknown.size:
            raise RoverFileError(
                f"curvature of pose {unknown[0]} is nan; it must be a number of 1/m, inf or -inf "
                "for a turn on the spot"
            )
        return curvature


def read_prediction(path: Path) -> tuple[PathPrediction, tuple[str, ...]]:
    """Read a file of `write_prediction`, without crossings between waypoints and bounds.

    Returns:
        The prediction of n waypoints, and for each the reason why it is not passable, "" if it
        is passable.

    Raises:
        PlanningError: The file is missing or is not a file of predictions.
    """
    with errors_of(path, PlanningError), open_npz(path) as archive:
        reason = archive.read_header("reason")
        if reason.dtype.kind != "U" or len(reason.shape) != 1 or reason.size == 0:
            raise RoverFileError("reason must be an array (n,) of texts, one for each waypoint")
        _check_count("reason", reason.size)
        for name, shape in ARRAYS.items():
            _check_header(archive.read_header(name), name, (reason.size, *shape))
        arrays: dict[str, Any] = {
            name: archive.read(
                name, TYPES.get(name, NUMBER_TYPE)[0], most=8 * reason.size * math.prod(shape)
            )
            for name, shape in ARRAYS.items()
        }
        reasons = tuple(archive.read("reason", most=MAX_REASONS).tolist())
    _check_numbers(path, arrays)
    poses, status = arrays.pop("poses"), arrays.pop("status")
    del arrays["settled"]
    return prediction_of(poses, status, arrays, "recorded"), reasons


def read_recorded_assumptions(path: Path) -> Assumptions | None:
    """Read what the prediction in a file was made for; None if the file does not tell.

    Raises:
        PlanningError: The file is missing, or the assumptions are invalid.
    """
    with errors_of(path, PlanningError), open_npz(path) as archive:
        if ASSUMPTIONS not in archive.names:
            return None
        header = archive.read_header(ASSUMPTIONS)
        if header.dtype.kind != "U" or header.shape != ():
            raise RoverFileError("assumptions must be one text")
        text = str(archive.read(ASSUMPTIONS, most=MAX_ASSUMPTIONS))
    try:
        return read_assumptions(text)
    except PlanningError as error:
        raise PlanningError(f"{show_file(path)}: {error}") from None


def _check_count(name: str, count: int) -> None:
    if count > MAX_POSES:
        raise RoverFileError(f"{name} has {count} rows; a file may have {MAX_POSES}")


def _check_header(header: ArrayHeader, name: str, shape: Shape) -> None:
    """Check type and shape of an array of a prediction."""
    _, kinds, what = TYPES.get(name, NUMBER_TYPE)
    if header.dtype.kind not in kinds:
        raise RoverFileError(f"{name} is of type {header.dtype}; it must hold {what}")
    if header.shape != shape:
        raise RoverFileError(
            f"{name} has shape {header.shape}; it must be {shape}, as there are {shape[0]} reasons"
        )


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


def write_prediction(
    path: Path,
    prediction: PathPrediction,
    verdict: Verdict,
    *,
    classes: "Sequence[ClassifiedWaypoint] | None" = None,
    ranges: "TorqueRanges | None" = None,
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


@contextmanager
def writing_parts(
    path: Path, count: int, assumptions: Assumptions | None = None
) -> Iterator["PartsFile"]:
    """Write a file as `write_prediction`, for a path that is too long to be kept in memory.

    Args:
        path: The file; an existing one is overwritten. Temporary files are made beside it.
        count: Number of waypoints.
        assumptions: As for `write_prediction`.

    Raises:
        PlanningError: A file cannot be written.
    """
    with errors_of(path, PlanningError), NpzParts(path.absolute().parent, count) as parts:
        yield PartsFile(path, parts, assumptions)


class PartsFile:
    """A file of a prediction whose waypoints come part by part."""

    def __init__(self, path: Path, parts: NpzParts, assumptions: Assumptions | None):
        self._path, self._parts, self._assumptions = path, parts, assumptions
        self._last: PathPrediction | None = None

    def take(self, prediction: PathPrediction) -> None:
        """Take the prediction of the next waypoints."""
        self._parts.add(_rows_of(prediction))
        self._last = prediction

    def close(self, verdict: Verdict, ranges: "TorqueRanges | None" = None) -> None:
        """Write the file with the verdict on all waypoints; arguments as `write_prediction`."""
        assert self._last is not None
        longest = max(1, max(map(len, verdict.reasons)))
        for first in range(0, len(verdict.reasons), BLOCK):
            block = np.array(verdict.reasons[first : first + BLOCK], f"<U{longest}")
            self._parts.add({"reason": block})
        summary = _summary_of(verdict, self._last, self._assumptions, ranges)
        self._parts.write(self._path, summary)


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
    ranges: "TorqueRanges | None",
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
