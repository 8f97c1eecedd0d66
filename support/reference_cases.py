# SPDX-License-Identifier: Apache-2.0
"""The settled cases of test/data, computed with MuJoCo: see test/data/README.md."""

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from rover_physics import PathPrediction, Terrain, judge_poses, load_rover

DATA = Path(__file__).resolve().parents[1] / "test" / "data"
STRAIGHT, STEERED = ("settled_a", "settled_b"), ("steered",)
"""Files of the cases with straight wheels, and with turned end wheels."""


@dataclass(frozen=True, eq=False)
class ReferenceGround:
    """A ground and the n poses at which the rover lsr1 settled on it."""

    label: str
    """File and ground, such as settled_a/rocks."""
    terrain: Terrain
    """The ground."""
    poses: np.ndarray
    """(n, 3) x, y [m] and yaw [rad] of the body origin."""
    wheel_centres: np.ndarray
    """(n, 6, 3) [m]."""
    forces: np.ndarray
    """(n, 6, 3) force of the ground on each wheel [N], map frame."""
    attitude: np.ndarray
    """(n, 2) roll and pitch [rad]."""
    joints: np.ndarray
    """(n, 4) angles of rocker right and left, bogie right and left [rad]."""
    curvature: np.ndarray
    """(n,) curvature that the end wheels are turned for [1/m], 0 where none is turned."""


@lru_cache
def reference_grounds(files: tuple[str, ...] = STRAIGHT) -> tuple[ReferenceGround, ...]:
    """Return all grounds of files with their cases."""
    found = []
    for file in files:
        with np.load(DATA / f"{file}.npz") as entries:
            meta = json.loads(str(entries["meta"]))
            for name in sorted({row["terrain"] for row in meta["rows"]}):
                rows = [row for row in meta["rows"] if row["terrain"] == name]
                terrain = Terrain(entries[f"terrain_{name}"], meta["res"], tuple(meta["origin"]))
                found.append(_read_cases(f"{file}/{name}", terrain, rows))
    return tuple(found)


def _read_cases(label: str, terrain: Terrain, rows: list[dict]) -> ReferenceGround:
    def column(*keys: str) -> np.ndarray:
        return np.array([[row[key] for key in keys] for row in rows])

    return ReferenceGround(
        label=label,
        terrain=terrain,
        poses=column("x", "y", "yaw"),
        wheel_centres=np.array([row["centre"] for row in rows]),
        forces=np.array([row["force"] for row in rows]),
        attitude=column("roll", "pitch"),
        joints=column("rocker_r", "rocker_l", "bogie_r", "bogie_l"),
        curvature=np.array([row.get("kappa", 0.0) for row in rows]),
    )


@lru_cache
def reference_predictions(
    files: tuple[str, ...] = STRAIGHT,
) -> tuple[tuple[ReferenceGround, PathPrediction], ...]:
    """Return the model's predictions for all cases of files under equal torques."""
    rover = load_rover("lsr1")
    return tuple(
        (case, judge_poses(rover, case.terrain, case.poses, case.curvature)[0])
        for case in reference_grounds(files)
    )


def reference_ground(label: str) -> ReferenceGround:
    """Return the ground of a label such as settled_a/rocks."""
    return next(case for case in reference_grounds() if case.label == label)
