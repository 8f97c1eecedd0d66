"""Of 20,000 poses on fractal ground and on rocks up to a wheel radius high nearly all settle."""

from functools import lru_cache

import numpy as np
import pytest

from rover_physics.prediction.sweep import sweep_path
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from support.rough_grounds import bouldered, fractal, random_poses
from support.rover_geometry import wheel_gaps

LSR1 = load_rover("lsr1")
SEEDS = range(10)
EVERY = 20
"""Of so many poses one is looked at by brute force."""


@lru_cache(maxsize=1)
def predictions() -> list[tuple[Terrain, PathPrediction]]:
    """Return 20 grounds with 1000 poses each."""
    grounds = [make(seed) for make in (fractal, bouldered) for seed in SEEDS]
    return [
        (ground, sweep_path(LSR1, ground, random_poses(k, 1000, 2.0)))
        for k, ground in enumerate(grounds)
    ]


@lru_cache(maxsize=1)
def brute_force_gaps() -> np.ndarray:
    """Return the gaps (n, 6) [m] of settled poses by a dense look at each wheel."""
    gaps = []
    for ground, prediction in predictions():
        for i in np.flatnonzero(prediction.settled)[::EVERY]:
            gaps.append(wheel_gaps(LSR1, ground, prediction, i))
    return np.array(gaps)


def test_of_20000_poses_999_in_1000_settle_and_the_others_say_that_they_do_not():
    statuses = np.concatenate([prediction.status for _, prediction in predictions()])
    assert statuses.size == 20_000
    assert set(statuses.tolist()) <= {PoseStatus.SETTLED, PoseStatus.NOT_SETTLED}
    assert (statuses == PoseStatus.SETTLED).mean() >= 0.999


def test_a_pose_that_does_not_settle_is_refused_as_such():
    for _, prediction in predictions():
        codes = np.array(judge(LSR1, prediction).codes)
        assert (codes[~prediction.settled] == "not_settled").all()


@pytest.mark.slow
def test_no_wheel_of_a_settled_pose_is_in_the_air():
    assert len(brute_force_gaps()) >= 990
    assert brute_force_gaps().max() <= 1e-4


def test_of_1000_settled_poses_980_have_all_wheels_within_a_tenth_of_a_millimetre():
    worst = np.abs(brute_force_gaps()).max(axis=1)
    assert (worst <= 1e-4).mean() >= 0.98
    assert worst.max() <= 1e-3


@pytest.mark.parametrize("make", [fractal, bouldered])
def test_the_grounds_are_as_rough_as_the_wheels_are_large(make):
    heights = np.concatenate([np.ravel(make(seed).elevation) for seed in SEEDS])
    assert np.ptp(heights) >= 2.0 * LSR1.wheel.radius
