# SPDX-License-Identifier: Apache-2.0
"""The drives and curves of test/data, computed with MuJoCo, and the model's answers to them."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from rover_physics import (
    PathPrediction,
    Rover,
    SweepOptions,
    Terrain,
    Verdict,
    judge_path,
    judge_poses,
    load_rover,
)
from rover_physics.traversability.verdict import hold_against_limits
from support.rough_grounds import bouldered, fractal

DRIVES = Path(__file__).resolve().parents[1] / "test" / "data" / "drives.json"
RESOLUTION = 0.02
"""Cell size of the grounds [m]."""
PASSED = "passed"
CURVES = Path(__file__).resolve().parents[1] / "test" / "data" / "curves.json"
KEPT = 0.5
"""Distance from the nominal end [m] within which a drive kept its curve."""
LENGTH, TURN = 2.4, np.pi
"""Length of an arc [m] and angle of a turn on the spot [rad]."""


@dataclass(frozen=True)
class ReferenceDrive:
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


def read_drives() -> tuple[ReferenceDrive, ...]:
    """Return all drives."""
    rows = json.loads(DRIVES.read_text())["rows"]
    return tuple(
        ReferenceDrive(
            row["kind"], row["size"], row["mu"], row["tau_max"], row["outcome"], row["x"]
        )
        for row in rows
    )


def drive_ground(kind: str, size: float, seed: int = 0) -> Terrain:
    """Return the ground of a drive; the formulas are those of test/data/README.md.

    Rocks and relief are drawn from a seed.
    """
    if kind == "rocks":
        return bouldered(seed, highest=size)
    if kind == "relief":
        return fractal(seed, roughness=size)
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


def judge_drive(drive: ReferenceDrive, policy: str) -> tuple[PathPrediction, Verdict]:
    """Return prediction and verdict of a drive."""
    rover = unlimited(load_rover("lsr1"))
    prediction = judge_path(
        rover,
        drive_ground(drive.kind, drive.size),
        drive_path(),
        SweepOptions(friction=drive.friction, max_torque=drive.max_torque, policy=policy),
    )[0]
    return prediction, hold_against_limits(rover, prediction)


def judge_drives(policy: str) -> Iterator[tuple[ReferenceDrive, PathPrediction, Verdict]]:
    """Yield every drive with its prediction and verdict."""
    for drive in read_drives():
        yield (drive, *judge_drive(drive, policy))


@dataclass(frozen=True, eq=False)
class Curve:
    """One drive of the rover lsr1 along an arc or a turn on the spot."""

    kind: str
    """flat, tilt, ramp, step or rocks."""
    size: float
    """Angle [deg], height [m] or seed."""
    mode: str
    """steered, spot, skid or skid_spot."""
    curvature: float
    """[1/m], infinite on the spot."""
    friction: float
    """Friction coefficient."""
    max_torque: float
    """Torque limit of the speed servos [N m]."""
    start: np.ndarray
    """(3,) x, y [m], yaw [rad]."""
    kept: bool
    """True if it went all the way and ended within KEPT of its nominal end."""
    poses: np.ndarray
    """(k, 3) poses of the trace."""
    forces: np.ndarray
    """(k, 6) size of the force on each wheel, mean since the pose before [N]."""
    torques: np.ndarray
    """(k, 6) mean torque of each wheel since the pose before [N m]."""

    @property
    def label(self) -> str:
        """Ground and mode."""
        return f"{self.kind} {self.size:g} {self.mode} {self.curvature:g}"

    @property
    def steered(self) -> bool:
        """True if the end wheels steer."""
        return self.mode in ("steered", "spot")


@lru_cache
def read_curves() -> tuple[Curve, ...]:
    """Return all curves."""
    return tuple(_read(row) for row in json.loads(CURVES.read_text())["rows"])


def _read(row: dict) -> Curve:
    trace = row["trace"]
    away = np.subtract(row["end"], row["nominal_end"])[:2]
    return Curve(
        kind=row["kind"],
        size=row["size"],
        mode=row["mode"],
        curvature=float(row["kappa"]),
        friction=row["mu"],
        max_torque=row["tau_max"],
        start=np.array(row["start"]),
        kept=row["outcome"] == "passed" and bool(np.hypot(*away) <= KEPT),
        poses=np.array([line["pose"] for line in trace]).reshape(-1, 3),
        forces=np.linalg.norm(
            np.array([line["force"] for line in trace]).reshape(-1, 6, 3), axis=2
        ),
        torques=np.array([line["torque"] for line in trace]).reshape(-1, 6),
    )


def curve_ground(kind: str, size: float) -> Terrain:
    """Return the ground of a curve; the formulas are those of test/data/README.md."""
    if kind == "step":
        return drive_ground(kind, size)
    if kind == "ramp":
        return drive_ground("slope", size)
    if kind == "tilt":
        return drive_ground("cross_slope", size)
    axis = -3.0 + RESOLUTION * np.arange(301)
    x, y = np.meshgrid(axis, axis)
    height = np.zeros(x.shape)
    if kind == "rocks":
        rng = np.random.default_rng(int(size))
        for _ in range(60):
            cx, cy = rng.uniform(-3.0, 3.0, 2)
            radius = rng.uniform(0.04, 0.12)
            if np.hypot(cx + 1.2, cy) >= 0.9:
                square = np.clip(radius**2 - (x - cx) ** 2 - (y - cy) ** 2, 0.0, None)
                height = np.maximum(height, np.sqrt(square) - 0.4 * radius)
    elif kind != "flat":
        raise ValueError(f"no curves on {kind!r}")
    return Terrain(height, RESOLUTION, (-3.0, -3.0))


def curve_path(curve: Curve, count: int = 241) -> np.ndarray:
    """Return waypoints (count, 3) of the nominal curve."""
    x, y, yaw = curve.start
    share = np.linspace(0.0, 1.0, count)
    if np.isinf(curve.curvature):
        return np.column_stack([x + 0.0 * share, y + 0.0 * share, yaw + TURN * share])
    turn = curve.curvature * LENGTH * share
    ahead, aside = np.sin(turn) / curve.curvature, (1.0 - np.cos(turn)) / curve.curvature
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack([x + c * ahead - s * aside, y + s * ahead + c * aside, yaw + turn])


def curve_rover(curve: Curve) -> Rover:
    """Return the rover of a curve, without limits that MuJoCo lacks."""
    rover = unlimited(load_rover("lsr1"))
    return rover if curve.steered else replace(rover, steering=None)


def curve_options(curve: Curve) -> SweepOptions:
    """Return the options of a curve under policy "servo"."""
    return SweepOptions(policy="servo", friction=curve.friction, max_torque=curve.max_torque)


def predict_trace(curve: Curve) -> PathPrediction:
    """Return the prediction at the poses of the trace."""
    return judge_poses(
        curve_rover(curve),
        curve_ground(curve.kind, curve.size),
        curve.poses,
        np.full(len(curve.poses), curve.curvature),
        curve_options(curve),
    )[0]
