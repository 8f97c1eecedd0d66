"""The drives of test/data, computed with MuJoCo, and the model's verdicts on them."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_path
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict, judge

DRIVES = Path(__file__).resolve().parents[1] / "test" / "data" / "drives.json"
RESOLUTION = 0.02
"""Cell size of the grounds [m]."""
PASSED = "passed"


@dataclass(frozen=True)
class Drive:
    """One drive of the rover lsr1 over an obstacle, from x = -1.2 to 1.2 along +x."""

    kind: str
    """step, ditch, bump_one_side, slope or cross_slope."""
    size: float
    """Height or width [m], or angle of a slope [deg]."""
    friction: float
    """Friction coefficient."""
    max_torque: float
    """Torque limit of the speed servos [N m]."""
    outcome: str
    """passed, stuck or tipped; tipped includes sliding off."""
    end: float
    """x at the end of the drive [m]."""

    @property
    def label(self) -> str:
        """Kind and size, such as step 0.163."""
        return (
            f"{self.kind} {self.size:.3f}" if self.size < 1.0 else f"{self.kind} {self.size:.1f}"
        )


def read_drives() -> tuple[Drive, ...]:
    """Return all drives."""
    rows = json.loads(DRIVES.read_text())["rows"]
    return tuple(
        Drive(row["kind"], row["size"], row["mu"], row["tau_max"], row["outcome"], row["x"])
        for row in rows
    )


def drive_ground(kind: str, size: float) -> Terrain:
    """Return the ground of a drive; the formulas are those of test/data/README.md."""
    axis = -3.0 + RESOLUTION * np.arange(301)
    x, y = np.meshgrid(axis, axis)
    if kind == "step":
        height = size * np.clip(x / RESOLUTION + 0.5, 0.0, 1.0)
    elif kind == "ditch":
        height = -0.15 * np.clip((size / 2 - abs(x)) / RESOLUTION + 0.5, 0.0, 1.0)
    elif kind == "bump_one_side":
        bump = size * np.clip((0.15 - abs(x)) / RESOLUTION + 0.5, 0.0, 1.0)
        height = np.where(y < 0.0, bump, 0.0)
    elif kind == "slope":
        a, t = np.tan(np.radians(size)), np.maximum((x + 0.3) / 0.6, 0.0)
        height = np.where(t < 1.0, 0.6 * a * t**2 / 2, 0.6 * a * (t - 0.5))
    elif kind == "cross_slope":
        k = np.clip(x + 0.9, 0.0, 1.0)
        height = np.tan(np.radians(size)) * k**2 * (3 - 2 * k) * y
    else:
        raise ValueError(f"no drives over {kind!r}")
    return Terrain(height, RESOLUTION, (-3.0, -3.0))


def drive_path(spacing: float = 0.01) -> np.ndarray:
    """Return the waypoints of every drive, `spacing` [m] apart."""
    along = np.linspace(-1.2, 1.2, round(2.4 / spacing) + 1)
    return np.column_stack([along, np.zeros((len(along), 2))])


def unlimited(rover: Rover) -> Rover:
    """Return `rover` without limits that MuJoCo lacks: tilt, margins, clearance, drops."""
    limits = replace(
        rover.limits, tilt=1.55, tip_over_ratio=0.0, belly_clearance=-10.0, wheel_drop=10.0
    )
    return replace(rover, limits=limits)


def judge_drive(drive: Drive, policy: str) -> tuple[PathPrediction, Verdict]:
    """Return prediction and verdict of a drive."""
    rover = unlimited(load_rover("lsr1"))
    prediction = sweep_path(
        rover,
        drive_ground(drive.kind, drive.size),
        drive_path(),
        SweepOptions(friction=drive.friction, max_torque=drive.max_torque, policy=policy),
    )
    return prediction, judge(rover, prediction)


def judge_drives(policy: str) -> Iterator[tuple[Drive, PathPrediction, Verdict]]:
    """Yield every drive with its prediction and verdict."""
    for drive in read_drives():
        yield (drive, *judge_drive(drive, policy))
