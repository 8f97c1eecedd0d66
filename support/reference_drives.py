# SPDX-License-Identifier: Apache-2.0
"""Ground, path and rover of the drives of test/data, which were computed with MuJoCo."""

from dataclasses import replace

import numpy as np

from rover_physics import Rover, Terrain
from support.grounds import bouldered, fractal
from support.paths import poses_at

RESOLUTION = 0.02
"""Cell size of the grounds [m]."""
KEPT = 0.5
"""Distance from the nominal end [m] within which a drive kept its path."""


def drive_ground(kind: str, size: float, seed: int = 0) -> Terrain:
    """Return the ground of a drive; the formulas are those of test/data/README.md.

    Rocks and relief are drawn from a seed; of caps, the rocks of curves, the size is the seed.
    """
    if kind == "rocks":
        return bouldered(seed, highest=size)
    if kind == "relief":
        return fractal(seed, roughness=size)
    axis = -3.0 + RESOLUTION * np.arange(301)
    x, y = np.meshgrid(axis, axis)
    if kind == "flat":
        height = np.zeros(x.shape)
    elif kind == "caps":
        height = _caps(x, y, int(size))
    elif kind == "step":
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


def _caps(x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    """Return the heights of spherical caps that leave the start of curves free."""
    rng, height = np.random.default_rng(seed), np.zeros(x.shape)
    for _ in range(60):
        cx, cy = rng.uniform(-3.0, 3.0, 2)
        radius = rng.uniform(0.04, 0.12)
        if np.hypot(cx + 1.2, cy) >= 0.9:
            square = np.clip(radius**2 - (x - cx) ** 2 - (y - cy) ** 2, 0.0, None)
            height = np.maximum(height, np.sqrt(square) - 0.4 * radius)
    return height


def drive_path(spacing: float = 0.01) -> np.ndarray:
    """Return the waypoints of every drive, `spacing` [m] apart."""
    return poses_at(np.linspace(-1.2, 1.2, round(2.4 / spacing) + 1))


def unlimited(rover: Rover) -> Rover:
    """Return `rover` without limits that MuJoCo lacks: tilt, margins, clearance, drops."""
    limits = replace(
        rover.limits, tilt=1.55, tip_over_ratio=0.0, belly_clearance=-10.0, wheel_drop=10.0
    )
    return replace(rover, limits=limits)
