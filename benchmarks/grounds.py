"""Grounds and poses that benchmarks run on."""

import json
import os
from pathlib import Path

import numpy as np

from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.worlds.mars_terrain import make_mars_terrain

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = ROOT / "test" / "data" / "settled_a.npz"
MARGIN = 0.8
"""Distance of the poses from the map's edge [m]: the rover stays on the map."""


def reference_ground(name: str) -> Terrain:
    """Return a ground of the reference cases, 6 x 6 m at 2 cm."""
    with np.load(REFERENCE) as entries:
        meta = json.loads(str(entries["meta"]))
        return Terrain(entries[f"terrain_{name}"], meta["res"], tuple(meta["origin"]))


def all_grounds() -> dict[str, Terrain]:
    """Return grounds by name: flat, rocks, fractal, a generated Mars terrain, and a real map."""
    grounds = {name: reference_ground(name) for name in ("flat", "rocks", "fractal")}
    grounds["Mars-like"] = make_mars_terrain(1)
    for name, terrain in list(real_maps().items())[:1]:
        grounds[f"real map {name}"] = terrain
    return grounds


def real_maps() -> dict[str, Terrain]:
    """Return the maps of the folder ROVER_TERRAIN_DIR by name."""
    folder = Path(os.environ.get("ROVER_TERRAIN_DIR", ROOT.parent / "shared" / "terrain"))
    return {path.stem: load_terrain(path) for path in sorted(folder.glob("*.npz"))}


def made_reef(seed: int = 1, half: float = 2.5, resolution: float = 0.01) -> Terrain:
    """Return ground as rough as a coral reef: steep heads and holes on relief, in small cells."""
    rng = np.random.default_rng(seed)
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


def random_poses(ground: Terrain, count: int) -> np.ndarray:
    """Return random poses (count, 3) on the ground with random headings."""
    rng = np.random.default_rng(0)
    xmin, xmax, ymin, ymax = ground.bounds
    low, high = (xmin + MARGIN, ymin + MARGIN), (xmax - MARGIN, ymax - MARGIN)
    places = rng.uniform(low, high, (count, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, count)])


def straight_paths(ground: Terrain, count: int) -> np.ndarray:
    """Return about `count` poses (n, 3) along straight paths, 2 cm apart."""
    xmin, xmax, ymin, ymax = ground.bounds
    along = np.arange(xmin + MARGIN, min(xmax - MARGIN, xmin + MARGIN + 10.0), 0.02)
    across = np.linspace(ymin + MARGIN, ymax - MARGIN, max(2, count // len(along)))
    y, x = np.meshgrid(across, along, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
