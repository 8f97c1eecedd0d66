# SPDX-License-Identifier: Apache-2.0
"""Checks the gaps of wheels on rough ground by a dense look at whole wheels."""

from collections.abc import Iterator

import numba
import numpy as np

from benchmarks.grounds import poses_anywhere
from benchmarks.measure import Figure
from rover_physics import Rover, Terrain, judge_poses, load_rover
from support.grounds import fractal
from support.rover_geometry import wheel_gaps

LOOKED_AT = 150
"""Settled poses that a dense look checks."""
CELLS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""Cell sizes of the grounds that are checked [wheel radii]."""


def measure() -> list[Figure]:
    """Measure the gaps of wheels by brute force."""
    numba.set_num_threads(1)
    return [figure for name in ("lsr1", "m2020") for figure in measure_gaps(load_rover(name))]


def measure_gaps(rover: Rover) -> Iterator[Figure]:
    """Compare the gaps of settled poses with a dense look, on cells of several sizes."""
    size = rover.wheel.radius / 0.1
    for cells in CELLS:
        ground = fractal(int(100 * cells))
        larger = Terrain(ground.elevation * size, cells * rover.wheel.radius, (0.0, 0.0))
        poses = poses_anywhere(larger, 20 * LOOKED_AT)
        prediction, _ = judge_poses(rover, larger, poses, np.zeros(len(poses)))
        settled = np.flatnonzero(prediction.settled)[:LOOKED_AT]
        gaps = np.array([wheel_gaps(rover, larger, prediction, i) for i in settled])
        worst = 1e3 * np.abs(gaps).max(axis=1)
        share = 100.0 * float((worst <= 0.1).mean())
        name = f"{rover.name}, cells of {cells:g} radii, brute force"
        yield Figure("rough", f"{name}: poses within 0.1 mm", share, "%", 99.9, True, repeats=1)
        yield Figure("rough", f"{name}: the worst", float(worst.max()), "mm", 1.0, repeats=1)
