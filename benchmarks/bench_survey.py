# SPDX-License-Identifier: Apache-2.0
"""Measures surveys as the command makes them: cost of a pose, workers, memory.

A large and a small map are surveyed, and the difference counts: start and compilation do not.
"""

import tempfile
from pathlib import Path

import numba
import numpy as np

from benchmarks.grounds import made_square
from benchmarks.measure import Figure, Run, median_time, peak_memory, run_command
from rover_physics import Terrain, load_rover, save_terrain, score_poses

CELLS = (192, 576)
"""Sides of the small and of the large map [cells]."""
HEADINGS = 8
WORKERS = (1, 2)
"""Numbers of workers that are compared."""
POSES = 20_000
"""Poses that are scored without a survey, for comparison."""


def measure() -> list[Figure]:
    """Survey both maps with one worker and with two."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        grounds = [made_square(7, cells) for cells in CELLS]
        runs: dict[tuple[int, int], Run] = {}
        for cells, ground in zip(CELLS, grounds, strict=True):
            save_terrain(folder / f"{cells}.npz", ground)
            for workers in WORKERS:
                files = folder / f"{cells}.npz", folder / f"{cells}_{workers}.zarr"
                options = "--headings", HEADINGS, "--workers", workers
                runs[cells, workers] = run_command("survey", "lsr1", *files, *options)
    return make_figures(runs, time_of_pose(grounds[1]))


def time_of_pose(ground: Terrain) -> float:
    """Return the CPU time of a pose at a random cell and heading by `score_poses` [s]."""
    numba.set_num_threads(1)
    rng, rover = np.random.default_rng(1), load_rover("lsr1")
    cells = rng.integers(0, ground.elevation.shape[::-1], (POSES, 2))
    yaw = 2.0 * np.pi / HEADINGS * rng.integers(0, HEADINGS, POSES)
    poses = np.column_stack([cells * ground.resolution + ground.origin, yaw])
    return median_time(lambda: score_poses(rover, ground, poses)) / POSES


def make_figures(runs: dict[tuple[int, int], Run], pose: float) -> list[Figure]:
    """Return the figures."""
    small, large = CELLS
    few, many = WORKERS
    clock = {n: runs[large, n].seconds - runs[small, n].seconds for n in WORKERS}
    cpu = runs[large, few].cpu - runs[small, few].cpu
    poses = HEADINGS * (large**2 - small**2)
    rows = (
        ("poses a second and core", poses / cpu, "1/s", None, False, ""),
        ("a pose, CPU time of all processes", cpu / poses / pose, "x", 1.1, False,
         "score_poses"),
        (f"{many} workers, by the clock", clock[few] / clock[many], "x", 1.7, True,
         f"{few} worker"),
        ("largest memory of a process", peak_memory(), "MB", 1024.0, False, ""),
    )  # fmt: skip
    return [Figure("survey", *row, repeats=1) for row in rows]
