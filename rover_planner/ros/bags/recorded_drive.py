# SPDX-License-Identifier: Apache-2.0
"""A drive as it was recorded: poses of the body and the suspension angles measured there."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_physics.names import SIDES
from rover_physics.results.path_prediction import PathPrediction
from rover_planner.angles import wrap

STEP = 0.05
"""Distance between recorded poses [m]; what lies between counts as noise of odometry."""
TURN = 0.05
"""Turn between recorded poses [rad]."""
ANGLES = tuple(f"{part}_{side}" for part in ("rocker", "bogie") for side in SIDES)
"""Suspension joints in the order of a row of angles."""


@dataclass(frozen=True)
class Measured:
    """Measurements at the waypoints of a prediction."""

    stamp: NDArray[np.int64]
    """(n,) time of recording [ns]."""
    rocker_angle: NDArray[np.float64]
    """(n, 2) right, left [rad]; NaN where it was not measured."""
    bogie_angle: NDArray[np.float64]
    """(n, 2) right, left [rad]; NaN where it was not measured."""

    def compare(self, prediction: PathPrediction) -> dict[str, float] | None:
        """Return rms and largest difference to a prediction [rad]; None without measurements."""
        off = np.hstack(
            [
                prediction.rocker_angle - self.rocker_angle,
                prediction.bogie_angle - self.bogie_angle,
            ]
        )
        off = off[np.isfinite(off)]
        if not off.size:
            return None
        return {"rms": float(np.sqrt(np.mean(off**2))), "largest": float(np.abs(off).max())}


@dataclass
class RecordedDrive:
    """The poses of a drive since its begin, STEP or TURN apart."""

    poses: list[NDArray[np.float64]] = field(default_factory=list)
    """(3,) x, y [m], yaw [rad], map frame."""
    stamps: list[int] = field(default_factory=list)
    """Time of each pose [ns]."""
    angles: list[list[float]] = field(default_factory=list)
    """ANGLES measured last before each pose [rad], NaN where none were."""
    length: float = 0.0
    """[m]."""

    def add(self, pose: NDArray[np.float64], stamp: int, joints: Mapping[str, float]) -> None:
        """Add a pose (3,) if the rover has moved."""
        if self.poses:
            step = float(np.hypot(*(pose[:2] - self.poses[-1][:2])))
            turn = wrap(pose[2] - self.poses[-1][2])
            if step < STEP and abs(turn) < TURN:
                return
            self.length += step
        self.poses.append(pose)
        self.stamps.append(stamp)
        self.angles.append([joints.get(name, np.nan) for name in ANGLES])

    def rest(self) -> "RecordedDrive":
        """Return the begin of the next stretch: the last pose of this one."""
        return RecordedDrive(self.poses[-1:], self.stamps[-1:], self.angles[-1:])

    def measured_at(self, poses: NDArray[np.float64]) -> Measured:
        """Return what was measured nearest to each of the waypoints (n, 3) of this drive."""
        driven, places = _progress(np.array(self.poses)), _progress(poses)
        scale = driven[-1] / places[-1] if places[-1] > 0.0 else 1.0
        rows = np.abs(driven[None, :] - scale * places[:, None]).argmin(axis=1)
        angles = np.array(self.angles)[rows]
        return Measured(np.array(self.stamps, np.int64)[rows], angles[:, :2], angles[:, 2:])


def _progress(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far along a drive each pose is: distance [m], a turn of 1 rad as STEP / TURN."""
    steps = np.diff(poses[:, :2], axis=0)
    turns = wrap(np.diff(poses[:, 2]))
    moved = np.hypot(steps[:, 0], steps[:, 1]) + STEP / TURN * np.abs(turns)
    return np.concatenate([[0.0], np.cumsum(moved)])
