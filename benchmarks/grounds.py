# SPDX-License-Identifier: Apache-2.0
"""Grounds, obstacles and poses that benchmarks run on."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_physics import SweepOptions, Terrain, load_terrain
from rover_planner.worlds.mars_terrain import make_mars_terrain
from support.paths import poses_at
from support.project.checkout import TOP
from support.reference_cases import reference_ground
from support.reference_drives import drive_ground


@dataclass(frozen=True)
class Obstacle:
    """A ground to drive over along +x."""

    kind: str
    """step, bump_one_side, ditch, slope, cross_slope, rocks or relief."""
    size: float
    """Height or width [m], angle [deg], largest height of rocks or RMS height of relief [m]."""
    friction: float
    """Friction coefficient."""
    seed: int = 0
    """Seed of rocks and relief."""
    max_torque: float | None = None
    """Largest torque of a wheel [N m]; None: that of the rover."""

    @property
    def label(self) -> str:
        """Kind, size, seed, friction and torque."""
        seed = f", seed {self.seed}" if self.seed else ""
        torque = "" if self.max_torque is None else f", {self.max_torque:.2f} N m"
        return f"{self.kind} {self.size:.3g}{seed}, mu {self.friction:.2g}{torque}"

    @property
    def ground(self) -> Terrain:
        """The ground."""
        return drive_ground(self.kind, self.size, self.seed)

    def options(self, policy: str) -> SweepOptions:
        """Return the options of a planner that knows friction and torque limit."""
        return SweepOptions(friction=self.friction, max_torque=self.max_torque, policy=policy)


def all_grounds() -> dict[str, Terrain]:
    """Return grounds by name: flat, rocks, fractal, a generated Mars terrain, and a real map."""
    names = ("flat", "rocks", "fractal")
    grounds = {name: reference_ground(f"settled_a/{name}").terrain for name in names}
    grounds["Mars-like"] = make_mars_terrain(1)
    return grounds | dict(list(real_maps().items())[:1])


def real_maps() -> dict[str, Terrain]:
    """Return the maps of the folder ROVER_TERRAIN_DIR by name."""
    folder = Path(os.environ.get("ROVER_TERRAIN_DIR", TOP.parent / "shared" / "terrain"))
    return {path.stem: load_terrain(path) for path in sorted(folder.glob("*.npz"))}


def made_square(seed: int, cells: int) -> Terrain:
    """Return a made Mars of so many cells a side, of 5 cm each."""
    ground = make_mars_terrain(seed, cells * 0.05, 0.05)
    return Terrain(ground.elevation[:cells, :cells], 0.05, ground.origin)


def made_reef() -> Terrain:
    """Return ground as rough as a coral reef: steep heads and holes on relief, in small cells."""
    rng, half, resolution = np.random.default_rng(1), 2.5, 0.01
    n = round(2.0 * half / resolution) + 1
    wave = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None, :])
    wave = np.maximum(wave, 1.0 / 120.0)
    z = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * wave**-2.0, s=(n, n))
    z *= 0.13 / z.std()
    x = -half + resolution * np.arange(n)
    X, Y = np.meshgrid(x, x)
    for _ in range(220):
        (cx, cy), height = rng.uniform(-half, half, 2), rng.uniform(0.1, 0.4)
        width, up = rng.uniform(0.05, 0.3), rng.random() < 0.6
        inside = np.clip(1.0 - ((X - cx) ** 2 + (Y - cy) ** 2) / width**2, 0.0, None)
        z += (1.0 if up else -1.0) * height * np.sqrt(inside)
    return Terrain(z, resolution, (-half, -half))


def poses_anywhere(terrain: Terrain, count: int) -> np.ndarray:
    """Return poses (count, 3) at random known cells with random headings."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.isfinite(terrain.elevation))
    at = cells[rng.integers(0, len(cells), count)] + rng.uniform(-0.5, 0.5, (count, 2))
    x, y = terrain.origin[0] + terrain.resolution * at[:, 1], terrain.resolution * at[:, 0]
    return np.column_stack([x, terrain.origin[1] + y, rng.uniform(-np.pi, np.pi, count)])


def straight(length: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    """Return poses (n, 3) every 2 cm along x, of a length and with their middle at x, y [m]."""
    return poses_at(x + np.arange(-0.5 * length, 0.5 * length, 0.02), y)
