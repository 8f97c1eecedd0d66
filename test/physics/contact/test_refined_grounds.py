# SPDX-License-Identifier: Apache-2.0
"""The same surface on cells of half the size gives the same poses and verdicts."""

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from support.rough_grounds import bouldered, fractal

LSR1 = load_rover("lsr1")
ALONG = np.arange(-0.5, 0.5, 0.02)


def refined(terrain: Terrain) -> Terrain:
    """Return the same bilinear surface on cells of half the size."""
    rows, columns = terrain.elevation.shape
    half = 0.5 * terrain.resolution
    x, y = np.meshgrid(np.arange(2 * columns - 1) * half, np.arange(2 * rows - 1) * half)
    heights = terrain.elevation_at(terrain.origin[0] + x, terrain.origin[1] + y)
    return Terrain(heights, half, terrain.origin)


@pytest.mark.parametrize("make", [fractal, bouldered])
def test_a_refined_copy_of_a_surface_gives_the_same_poses_and_verdicts(make):
    rng, moved = np.random.default_rng(5), []
    for seed in range(2):
        ground = make(seed)
        copy = refined(ground)
        for _ in range(3):
            (x, y), yaw = rng.uniform(-1.5, 1.5, 2), rng.uniform(-np.pi, np.pi)
            places = x + ALONG * np.cos(yaw), y + ALONG * np.sin(yaw), np.full_like(ALONG, yaw)
            poses = np.column_stack(places)
            (here, verdict), (there, other) = (
                judge_path(LSR1, terrain, poses) for terrain in (ground, copy)
            )
            both = here.settled & there.settled
            assert both.mean() >= 0.99
            assert other.traversable == verdict.traversable
            centres = np.abs(there.wheel_centres - here.wheel_centres)[both]
            moved.append(centres.max(axis=(1, 2)))
    moved = np.concatenate(moved)
    assert np.median(moved) <= 1e-7
    assert np.quantile(moved, 0.99) <= 1e-4
