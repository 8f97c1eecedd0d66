# SPDX-License-Identifier: Apache-2.0
"""Of 20,000 poses on rough ground nearly all settle; finer cells of a surface change none.

The quick tests look at 2,000 of them.
"""

from functools import lru_cache

import numpy as np
import pytest

from rover_physics import PathPrediction, PoseStatus, Terrain, judge_path, judge_poses
from rover_physics.traversability.verdict import hold_against_limits
from support.paths import poses_at
from support.rough_grounds import bouldered, fractal, random_poses
from support.rover_geometry import wheel_axes, wheel_gap, wheel_gaps
from support.rovers import LSR1

few_and_all = pytest.mark.parametrize("seeds", [1, pytest.param(10, marks=pytest.mark.long)])
EVERY = 50
"""Of so many poses one wheel of one pose is looked at by brute force."""


@lru_cache(maxsize=1)
def predictions(seeds: int) -> list[tuple[Terrain, PathPrediction]]:
    """Return grounds with 1000 poses each, two of each seed."""
    grounds = [make(seed) for make in (fractal, bouldered) for seed in range(seeds)]
    return [
        (ground, judge_path(LSR1, ground, random_poses(k, 1000, 2.0))[0])
        for k, ground in enumerate(grounds)
    ]


@few_and_all
def test_999_in_1000_poses_settle_and_the_others_are_refused_as_not_settled(seeds):
    statuses = np.concatenate([prediction.status for _, prediction in predictions(seeds)])
    assert set(statuses.tolist()) <= {PoseStatus.SETTLED, PoseStatus.NOT_SETTLED}
    assert (statuses == PoseStatus.SETTLED).mean() >= 0.999
    for _, prediction in predictions(seeds):
        codes = np.array(hold_against_limits(LSR1, prediction).codes)
        assert (codes[~prediction.settled] == "not_settled").all()


@few_and_all
def test_999_of_1000_wheels_touch_within_a_tenth_of_a_millimetre_and_none_is_in_the_air(seeds):
    gaps = []
    for ground, prediction in predictions(seeds):
        for k, i in enumerate(np.flatnonzero(prediction.settled)[::EVERY]):
            centre, axis = prediction.wheel_centres[i, k % 6], wheel_axes(LSR1, prediction, i)
            gaps.append(wheel_gap(LSR1, ground, centre, axis[k % 6]))
    gaps = np.array(gaps)
    assert gaps.size >= 39 * seeds
    assert (np.abs(gaps) <= 1e-4).mean() >= 0.999
    assert gaps.min() >= -1e-3 and gaps.max() <= 1e-4


def test_no_rim_sinks_into_steep_cells_almost_as_large_as_the_wheel():
    heights = np.random.default_rng(0).normal(0.0, 0.13, (61, 61))
    ground, poses = Terrain(heights, 0.09, (-2.7, -2.7)), random_poses(0, 40, 1.5)
    prediction = judge_poses(LSR1, ground, poses, np.zeros(len(poses)))[0]
    settled = np.flatnonzero(prediction.settled)
    assert settled.size >= 39
    gaps = np.array([wheel_gaps(LSR1, ground, prediction, i) for i in settled])
    assert gaps.min() >= -1e-4


def test_no_rim_sinks_into_cells_twenty_times_as_large_as_the_wheel():
    heights = [[-0.75, -1.22, -0.97], [-1.45, -1.37, -1.39], [-1.43, -2.79, -2.34]]
    ground = Terrain(np.array(heights), 2.0, (-2.0, -2.0))
    prediction = judge_poses(LSR1, ground, [[-0.13, 0.08, -1.24]])[0]
    assert wheel_gaps(LSR1, ground, prediction, 0).min() >= -1e-4


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
            poses = poses_at(x + ALONG * np.cos(yaw), y + ALONG * np.sin(yaw), yaw)
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
