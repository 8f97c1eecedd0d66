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
    folder = Path(os.environ.get("ROVER_TERRAIN_DIR", ROOT.parent / "shared" / "terrain"))
    for path in sorted(folder.glob("*.npz"))[:1]:
        grounds[f"real map {path.stem}"] = load_terrain(path)
    return grounds


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
