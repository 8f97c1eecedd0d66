# SPDX-License-Identifier: Apache-2.0
"""Symmetries: mirrored, turned, moved, larger, heavier or the other way round, it is the same."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics import Rover, SweepOptions, Terrain, judge_paths, judge_poses
from support.grounds import bouldered, enlarged, random_poses, rocky, scaled_for, smooth, with_std
from support.paths import arc_of, poses_at
from support.rover_geometry import ANGLE, GAP, turned_round
from support.rovers import LSR1, M2020, SIMILAR, similar

SWAP = [3, 4, 5, 0, 1, 2]
ROUND = [5, 4, 3, 2, 1, 0]
AHEAD = np.zeros(4)
seeds = st.integers(0, 10_000)
few = settings(max_examples=12)


def quarter_turn(terrain: Terrain, poses: np.ndarray) -> tuple[Terrain, np.ndarray]:
    """Return ground and poses, both rotated by 90 degrees about the map's z: x -> y, y -> -x."""
    xmin, xmax, ymin, ymax = terrain.bounds
    turned = replace(
        terrain, elevation=np.ascontiguousarray(terrain.elevation.T[:, ::-1]), origin=(-ymax, xmin)
    )
    return turned, np.column_stack([-poses[:, 1], poses[:, 0], poses[:, 2] + 0.5 * np.pi])


def mirrored(terrain: Terrain, poses: np.ndarray) -> tuple[Terrain, np.ndarray]:
    """Return ground and poses mirrored: y -> -y."""
    origin = terrain.origin[0], -terrain.bounds[3]
    flipped = replace(terrain, elevation=terrain.elevation[::-1].copy(), origin=origin)
    return flipped, poses * [1.0, -1.0, -1.0]


@few
@given(seeds, st.sampled_from([0.0, 0.7, np.inf]))
def test_mirrored_ground_swaps_right_and_left(seed, curvature):
    ground, poses, bends = smooth(seed), random_poses(seed, 4, 0.6), np.full(4, curvature)
    here = judge_poses(LSR1, ground, poses, bends)[0]
    there = judge_poses(LSR1, *mirrored(ground, poses), -bends)[0]
    assert here.settled.all() and there.settled.all()
    flipped, loose = np.array([1.0, -1.0, 1.0]), 1e-3 * LSR1.weight
    for name, expected, tolerance in (
        ("position", here.position * flipped, 2.0 * GAP),
        ("roll", -here.roll, ANGLE),
        ("pitch", here.pitch, ANGLE),
        ("rocker_angle", here.rocker_angle[:, ::-1], ANGLE),
        ("bogie_angle", here.bogie_angle[:, ::-1], ANGLE),
        ("wheel_centres", here.wheel_centres[:, SWAP] * flipped, ANGLE),
        ("wheel_loads", here.wheel_loads[:, SWAP], loose),
        ("lateral", -here.lateral[:, SWAP], loose),
        ("torque", here.torque[:, SWAP], 2e-3),
        ("tip_over_ratio", here.tip_over_ratio, 1e-4),
        ("tip_over_force_angle", here.tip_over_force_angle, 1e-4),
    ):
        assert getattr(there, name) == pytest.approx(expected, abs=tolerance), name


def test_bounds_on_mirrored_ground_swap_right_and_left():
    """They depended on which wheels are first, by up to a hundredth."""
    ground, poses = with_std(smooth(3), 0.003), random_poses(3, 12, 0.6)
    here = judge_poses(LSR1, ground, poses)[0].bounds
    there = judge_poses(LSR1, *mirrored(ground, poses))[0].bounds
    assert here.bounded.all()
    expected = here.friction_utilisation[:, SWAP]
    assert there.friction_utilisation == pytest.approx(expected, rel=3e-4)


@few
@given(seeds, st.integers(0, 3), st.tuples(*[st.floats(-50.0, 50.0)] * 3))
def test_turned_by_quarters_and_moved_with_its_path_the_ground_changes_nothing(
    seed, quarters, shift
):
    ground, poses = smooth(seed), random_poses(seed, 4, 0.6)
    turned, path = ground, poses
    for _ in range(quarters):
        turned, path = quarter_turn(turned, path)
    (x, y), (dx, dy, dz) = turned.origin, shift
    turned = Terrain(turned.elevation + dz, turned.resolution, (x + dx, y + dy))
    here = judge_poses(LSR1, ground, poses, AHEAD)[0]
    there = judge_poses(LSR1, turned, path + np.array([dx, dy, 0.0]), AHEAD)[0]
    assert here.settled.all() and there.settled.all()
    for name in ("roll", "pitch", "rocker_angle", "bogie_angle"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), abs=ANGLE), name
    assert there.position[:, 2] == pytest.approx(here.position[:, 2] + dz, abs=2.0 * GAP)
    assert there.wheel_loads == pytest.approx(here.wheel_loads, abs=1e-3 * LSR1.weight)


@few
@given(seeds, st.sampled_from([replace(LSR1, manipulator=None), M2020]))
def test_a_bogie_behind_is_a_bogie_ahead_driven_backwards(seed, rover):
    ground, poses = scaled_for(rover, smooth(seed), random_poses(seed, 4, 0.5))
    here = judge_poses(rover, ground, poses, AHEAD)[0]
    there = judge_poses(turned_round(rover), ground, poses + np.array([0.0, 0.0, np.pi]), AHEAD)[0]
    assert here.settled.all() and there.settled.all()
    size, loose = rover.wheel.radius, 1e-3 * rover.weight
    for name, expected, tolerance in (
        ("position", here.position, 1e-4 * size),
        ("wheel_centres", here.wheel_centres[:, ROUND], 1e-3 * size),
        ("wheel_loads", here.wheel_loads[:, ROUND], loose),
        ("tangential", -here.tangential[:, ROUND], loose),
        ("lateral", -here.lateral[:, ROUND], loose),
        ("tip_over_ratio", here.tip_over_ratio, 1e-3),
    ):
        assert getattr(there, name) == pytest.approx(expected, abs=tolerance), name


# Of another size, mass or gravity

RATIOS = (
    "status", "contact_angle", "friction_utilisation", "torque_saturation", "slip_ratio",
    "tip_over_ratio", "tip_over_force_angle", "speed_share", "falling", "roll", "pitch",
)  # fmt: skip
LENGTHS = ("belly_clearance", "wheel_drop", "lift_height", "wheel_centres", "distance")

PATHS = [
    arc_of(bend, 0.02 * np.arange(50), yaw) + poses_at(-0.9, y)
    for y in (-0.8, 0.2)
    for yaw, bend in ((0.0, 0.0), (0.4, 0.7))
]


def judge(rover: Rover, ground: Terrain, policy: str):
    """Yield what is told of each of PATHS on ground as large as the rover, without units."""
    size = rover.wheel.radius / LSR1.wheel.radius
    paths = [path * [size, size, 1.0] for path in PATHS]
    asked = rover, enlarged(ground, size), paths, SweepOptions(policy=policy)
    judged = judge_paths(*asked, accepted_chance=0.05)
    for prediction, verdict in judged:
        yield "verdict", (verdict.codes, verdict.first_failure, verdict.failure_chance)
        for name in RATIOS:
            yield name, getattr(prediction, name)
        for name in LENGTHS:
            yield name, getattr(prediction, name) / size
        yield "wheel_loads", prediction.wheel_loads / rover.weight


@pytest.mark.parametrize("like", SIMILAR)
@pytest.mark.parametrize(
    ("ground", "policy"),
    [
        (with_std(smooth(3), 0.004), "equal"),
        (bouldered(2), "servo"),
        (rocky(1), "servo"),
        (rocky(1), "optimal"),
    ],
    ids=["uncertain", "boulders", "rocks", "control"],
)
def test_similar_rovers_get_the_same_verdict_to_the_bit(ground, policy, like):
    there = judge(similar(LSR1, *SIMILAR[like]), ground, policy)
    for (name, expected), (_, found) in zip(judge(LSR1, ground, policy), there, strict=True):
        np.testing.assert_equal(found, expected, err_msg=name)
