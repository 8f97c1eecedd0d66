"""Reads and writes the files of the `predict` command: poses and predictions."""

import io
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import BOUNDED_VALUES
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.traversability.classification import ClassifiedWaypoint
from rover_physics.traversability.torque_ranges import TorqueRanges
from rover_physics.traversability.verdict import Verdict
from rover_planner.errors import PlanningError

ARRAYS = (
    "settled",
    "position",
    "roll",
    "pitch",
    "rocker_angle",
    "bogie_angle",
    "wheel_centres",
    "wheel_loads",
    "tangential",
    "lateral",
    "friction_utilisation",
    "slip_ratio",
    "torque_saturation",
    "tip_over_ratio",
    "tip_over_force_angle",
    "belly_clearance",
    "energy",
    "time",
)
"""Arrays of a prediction in the output file, under the same names."""
REPLAY_ARRAYS = (
    "poses",
    "status",
    "contact_points",
    "contact_angle",
    "torque",
    "friction",
    "sinkage",
    "motion_resistance",
    "power",
    "distance",
    "wheel_drop",
    "falling",
)
"""Further arrays in the file that `rover_planner view` needs to replay it."""
SOIL_ARRAYS = ("sinkage", "motion_resistance")
"""Further arrays in the file if a soil was given or the terrain has soils."""


def read_poses(path: Path) -> NDArray[np.float64]:
    """Read `poses` (n, 3), x, y [m] and yaw [rad] of the body origin, from an .npz file.

    Raises:
        PlanningError: The file is missing or not an .npz file, or has no such array of numbers.
    """
    poses = _read_arrays(path, ("poses",), "poses")["poses"]
    if poses.dtype.kind not in "fiu":
        raise PlanningError(f"poses in {path} are of type {poses.dtype}; they must be numbers")
    if poses.ndim != 2 or poses.shape[1] != 3 or len(poses) == 0:
        raise PlanningError(
            f"poses in {path} have shape {poses.shape}; they must be (n, 3): x, y, yaw"
        )
    return poses.astype(np.float64)


def _read_arrays(path: Path, names: Sequence[str], what: str) -> dict[str, Any]:
    """Read arrays by name from an .npz file; errors name its kind, `what`."""
    try:
        archive = np.load(path, allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise PlanningError(f"{path} holds one bare array; it must be an .npz file")
        with archive:
            for name in names:
                if name not in archive:
                    there = ", ".join(archive.files) or "nothing"
                    raise PlanningError(f"{path} has no array {name!r}; it has {there}")
            return {name: archive[name] for name in names}
    except FileNotFoundError:
        raise PlanningError(f"no {what} file {path}") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise PlanningError(f"{path} is no readable .npz file of {what}: {error}") from None


def read_prediction(path: Path) -> tuple[PathPrediction, tuple[str, ...]]:
    """Read a file of `write_prediction`, without crossings between waypoints and bounds.

    Returns:
        The prediction of n waypoints, and for each the reason why it is not passable, "" if it
        is passable.

    Raises:
        PlanningError: The file is missing or is not a file of predictions.
    """
    arrays = _read_arrays(path, (*ARRAYS, *REPLAY_ARRAYS, "reason"), "predictions")
    reasons = tuple(arrays.pop("reason").tolist())
    lengths = {name: len(values) for name, values in arrays.items()}
    if set(lengths.values()) != {len(reasons)}:
        raise PlanningError(f"the arrays of {path} differ in length: {lengths}")
    rest: dict[str, Any] = {"between": None, "policy": "recorded"}
    return PathPrediction(**arrays, waypoint=np.arange(len(reasons)), **rest), reasons


def write_prediction(
    path: Path,
    prediction: PathPrediction,
    verdict: Verdict,
    *,
    on_soil: bool = False,
    classes: Sequence[ClassifiedWaypoint] | None = None,
    ranges: TorqueRanges | None = None,
) -> None:
    """Write a prediction and its verdict to an .npz file; the file name is not extended.

    The file has the ARRAYS, `reason` (n,) text, empty if passable, `traversable` () bool, and
    `first_failure` () int, -1 if there is none. On an uncertain map it also has `map_sigmas` ()
    and for each of BOUNDED_VALUES its `..._bounds`, with minimum and maximum in the last axis.

    Args:
        path: The file; an existing one is overwritten.
        prediction: Prediction of n waypoints.
        verdict: Verdict on them.
        on_soil: Whether to write SOIL_ARRAYS (n, 6), in m and N.
        classes: Class of each waypoint, written as `traversability_class`, `class_constraint` and
            `class_wheel` (n,) text and `class_margin` (n,).
        ranges: Torque ranges, written as `torque_range` (n, 6, 2), minimum and maximum [N m].

    Raises:
        PlanningError: The file cannot be written.
    """
    names = dict.fromkeys(ARRAYS + REPLAY_ARRAYS + (SOIL_ARRAYS if on_soil else ()))
    arrays = {name: getattr(prediction, name) for name in names}
    arrays["reason"] = np.array(verdict.reasons, dtype=np.str_)
    arrays["traversable"] = np.array(verdict.traversable, dtype=np.bool_)
    arrays["first_failure"] = np.array(verdict.first_failure, dtype=np.int64)
    if prediction.bounds is not None:
        arrays["map_sigmas"] = np.array(prediction.bounds.sigmas)
        for name in BOUNDED_VALUES:
            arrays[f"{name}_bounds"] = getattr(prediction.bounds, name)
    if classes is not None:
        for name in ("traversability_class", "constraint", "wheel"):
            texts = np.array([getattr(waypoint, name) for waypoint in classes], dtype=np.str_)
            arrays[name if name == "traversability_class" else f"class_{name}"] = texts
        arrays["class_margin"] = np.array([waypoint.margin for waypoint in classes])
    if ranges is not None:
        arrays["torque_range"] = np.stack([ranges.lowest, ranges.highest], axis=-1)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    try:
        path.write_bytes(buffer.getvalue())
    except OSError as error:
        raise PlanningError(f"cannot write {path}: {error.strerror}") from None
