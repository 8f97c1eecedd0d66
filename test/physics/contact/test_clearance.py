"""Clearance: the belly's height over the highest known ground below it, and only below it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.prediction.sweep import sweep_path, sweep_poses
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from support.rough_grounds import plane, random_poses, smooth
from support.rover_geometry import attitude_of

LSR1 = load_rover("lsr1")
RESOLUTION = 0.02
HALF = 60


def level_with(height: float, x: float, y: float) -> Terrain:
    """Return level ground with one cell raised (or unknown) at (x, y)."""
    z = np.zeros((2 * HALF + 1, 2 * HALF + 1))
    z[round(y / RESOLUTION) + HALF, round(x / RESOLUTION) + HALF] = height
    return Terrain(z, RESOLUTION, (-HALF * RESOLUTION, -HALF * RESOLUTION))


def clearance(ground: Terrain, yaw: float = 0.0) -> float:
    prediction = sweep_path(LSR1, ground, [[0.0, 0.0, yaw]])
    assert prediction.settled.all()
    return float(prediction.belly_clearance[0])


def test_on_level_ground_it_is_the_height_of_the_belly():
    assert clearance(level_with(0.0, 0.0, 0.0)) == pytest.approx(0.24, abs=1e-6)


def test_a_tilted_plane_is_as_far_as_level_ground_measured_upwards():
    assert clearance(plane(0.3, 0.0)) == pytest.approx(0.24 / np.cos(np.arctan(0.3)), abs=1e-4)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.28, 0.18), (-0.28, -0.18), (0.28, -0.18)])
@pytest.mark.parametrize("height", [0.05, 0.30])
def test_a_stone_under_the_belly_takes_its_height(x, y, height):
    assert clearance(level_with(height, x, y)) == pytest.approx(0.24 - height, abs=1e-6)


@pytest.mark.parametrize(("x", "y"), [(0.34, 0.0), (-0.34, 0.0), (0.0, 0.24), (0.0, -0.24)])
def test_a_stone_beside_the_belly_takes_nothing(x, y):
    assert clearance(level_with(0.20, x, y)) == pytest.approx(0.24, abs=1e-6)


def test_the_outline_turns_with_the_rover():
    beside = level_with(0.20, 0.0, 0.24)
    assert clearance(beside) == pytest.approx(0.24, abs=1e-6)
    assert clearance(beside, yaw=np.pi / 2) == pytest.approx(0.04, abs=1e-6)


def test_unknown_cells_under_the_belly_are_passed_over():
    assert clearance(level_with(np.nan, 0.0, 0.0)) == pytest.approx(0.24, abs=1e-6)


def test_without_known_ground_below_it_is_unknown():
    z = np.zeros((2 * HALF + 1, 2 * HALF + 1))
    z[HALF - 11 : HALF + 12, HALF - 16 : HALF + 17] = np.nan
    ground = Terrain(z, RESOLUTION, (-HALF * RESOLUTION, -HALF * RESOLUTION))
    assert np.isnan(clearance(ground))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_it_is_what_a_look_at_every_cell_gives(seed):
    ground = smooth(seed)
    prediction = sweep_poses(LSR1, ground, random_poses(seed, 2, 0.6), np.zeros(2))
    assert prediction.settled.all()
    ny, nx = ground.elevation.shape
    x, y = np.meshgrid(
        ground.origin[0] + np.arange(nx) * ground.resolution,
        ground.origin[1] + np.arange(ny) * ground.resolution,
    )
    for i in range(2):
        R, origin = attitude_of(prediction, i), prediction.position[i]
        belly_z = (-0.06 - R[0, 2] * (x - origin[0]) - R[1, 2] * (y - origin[1])) / R[2, 2]
        place = np.stack([x - origin[0], y - origin[1], belly_z], axis=-1) @ R
        below = (np.abs(place[..., 0]) <= 0.30) & (np.abs(place[..., 1]) <= 0.20)
        heights = (origin[2] + belly_z - ground.elevation)[below]
        assert prediction.belly_clearance[i] == pytest.approx(heights.min(), abs=1e-9)


def test_between_cells_larger_than_the_belly_the_ground_there_counts():
    coarse = Terrain(np.zeros((9, 9)), 1.0, (-3.5, -3.5))
    assert clearance(coarse) == pytest.approx(0.24, abs=1e-6)
    rise = 0.05 * (-3.5 + np.arange(9.0))
    slope = Terrain(np.tile(rise, (9, 1)), 1.0, (-3.5, -3.5))
    assert clearance(slope) == pytest.approx(0.24 / np.cos(np.arctan(0.05)), abs=1e-4)


def test_it_stays_within_its_bounds_between_cells_larger_than_the_belly():
    ground = Terrain(np.zeros((9, 9)), 1.0, (-3.5, -3.5), elevation_std=np.full((9, 9), 0.001))
    prediction, verdict = judge_path(LSR1, ground, [[0.0, 0.0, 0.3]])
    low, high = prediction.bounds.belly_clearance[0]
    assert low < prediction.belly_clearance[0] < high
    assert low == pytest.approx(0.24, abs=0.02) and high == pytest.approx(0.24, abs=0.02)
    assert verdict.traversable
