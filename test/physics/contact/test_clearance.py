# SPDX-License-Identifier: Apache-2.0
"""Clearance: the belly's height over the highest known ground below it, and only below it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path, judge_poses
from support.rough_grounds import plane, random_poses, rocky, smooth
from support.rover_geometry import attitude_of

LSR1 = load_rover("lsr1")
HALF, RESOLUTION = 60, 0.02
COARSE = 0.05 * (-3.5 + np.arange(9.0))
"""Heights of a slope on cells larger than the belly [m]."""


def level_with(height: float, rows: slice, columns: slice) -> Terrain:
    """Return level ground with cells raised (or unknown), counted from under the rover."""
    z = np.zeros((2 * HALF + 1, 2 * HALF + 1))
    z[HALF + rows.start : HALF + rows.stop, HALF + columns.start : HALF + columns.stop] = height
    return Terrain(z, RESOLUTION, (-HALF * RESOLUTION, -HALF * RESOLUTION))


@pytest.mark.parametrize(
    ("ground", "clearance"),
    [
        (plane(0.0, 0.0), 0.24),
        (plane(0.3, 0.0), 0.24 / np.cos(np.arctan(0.3))),  # measured upwards
        (level_with(0.05, slice(0, 1), slice(0, 1)), 0.19),
        (level_with(0.30, slice(-9, -8), slice(14, 15)), -0.06),
        (level_with(0.20, slice(0, 1), slice(17, 18)), 0.24),  # before the belly
        (level_with(0.20, slice(12, 13), slice(0, 1)), 0.24),  # beside it
        (level_with(np.nan, slice(0, 1), slice(0, 1)), 0.24),  # unknown cells are passed over
        (level_with(np.nan, slice(-11, 12), slice(-16, 17)), np.nan),
        (Terrain(np.zeros((9, 9)), 1.0, (-3.5, -3.5)), 0.24),
        (Terrain(np.tile(COARSE, (9, 1)), 1.0, (-3.5, -3.5)), 0.24 / np.cos(np.arctan(0.05))),
    ],
)
def test_it_is_the_height_of_the_belly_above_the_highest_known_ground_below(ground, clearance):
    prediction = judge_path(LSR1, ground, [[0.0, 0.0, 0.0]])[0]
    assert prediction.settled.all()
    apart = 1e-6 if prediction.pitch[0] == pytest.approx(0.0, abs=1e-9) else 1e-4
    assert prediction.belly_clearance[0] == pytest.approx(clearance, abs=apart, nan_ok=True)


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.sampled_from([smooth, rocky]))
def test_it_is_what_a_look_at_every_cell_gives(seed, make):
    ground = make(seed)
    prediction = judge_poses(LSR1, ground, random_poses(seed, 2, 0.6), np.zeros(2))[0]
    ny, nx = ground.elevation.shape
    x, y = np.meshgrid(
        ground.origin[0] + np.arange(nx) * ground.resolution,
        ground.origin[1] + np.arange(ny) * ground.resolution,
    )
    for i in np.flatnonzero(prediction.settled):
        R, origin = attitude_of(prediction, i), prediction.position[i]
        belly_z = (-0.06 - R[0, 2] * (x - origin[0]) - R[1, 2] * (y - origin[1])) / R[2, 2]
        place = np.stack([x - origin[0], y - origin[1], belly_z], axis=-1) @ R
        below = (np.abs(place[..., 0]) <= 0.30) & (np.abs(place[..., 1]) <= 0.20)
        heights = (origin[2] + belly_z - ground.elevation)[below]
        assert prediction.belly_clearance[i] == pytest.approx(heights.min(), abs=1e-9)


def test_it_stays_within_its_bounds_between_cells_larger_than_the_belly():
    ground = Terrain(np.zeros((9, 9)), 1.0, (-3.5, -3.5), elevation_std=np.full((9, 9), 0.001))
    prediction, verdict = judge_path(LSR1, ground, [[0.0, 0.0, 0.3]])
    low, high = prediction.bounds.belly_clearance[0]
    assert low < prediction.belly_clearance[0] < high
    assert low == pytest.approx(0.24, abs=0.02) and high == pytest.approx(0.24, abs=0.02)
    assert verdict.traversable
