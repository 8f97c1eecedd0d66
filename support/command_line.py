# SPDX-License-Identifier: Apache-2.0
"""Command-line helpers for tests: input files of `rover_planner`, and a check of refusals."""

from pathlib import Path

import numpy as np

from rover_physics import Terrain, save_terrain
from rover_planner.shell.run_program import MAX_LINE

N = 30
"""Number of poses of the path in `write_ground_and_path`."""


def write_ground_and_path(folder: Path) -> Path:
    """Write a flat terrain with a hole, and a path that ends before it; return the folder."""
    elevation = np.zeros((80, 120))
    elevation[:, 100:] = np.nan
    save_terrain(folder / "terrain.npz", Terrain(elevation, 0.05, (0.0, 0.0)))
    poses = np.column_stack([np.linspace(1, 3, N), np.full(N, 2.0), np.zeros(N)])
    np.savez(folder / "poses.npz", poses=poses)
    return folder


def predict_arguments(folder: Path, terrain="terrain.npz", out="out.npz") -> list[str]:
    """Return the arguments of `rover_planner predict` for files of a folder and the rover lsr1."""
    return ["predict", "lsr1", *(str(folder / name) for name in (terrain, "poses.npz", out))]


def assert_refused(capfd, code: int, word: str) -> None:
    """Assert that the exit code is 2 and that stderr has one short line, which has a word."""
    line = capfd.readouterr().err
    assert code == 2, line
    assert line.startswith("rover_planner: ")
    assert line.count("\n") == 1 and len(line) <= MAX_LINE + 1
    assert line[:-1].isprintable() and "Traceback" not in line
    assert word in line
