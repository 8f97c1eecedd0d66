# SPDX-License-Identifier: Apache-2.0
"""Scores of poses are those of a path, whatever the batches; a map is swept cell by cell."""

import numpy as np
import pytest

import rover_physics.prediction.map_sweep as map_sweep
from rover_physics.prediction.map_sweep import score_poses, sweep_map
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from support.grounds import gap, make_terrain, rocky

ROVER = load_rover("lsr1")


def poses_on(terrain: Terrain, shape) -> np.ndarray:
    """Return poses (*shape, 3) on and somewhat beyond a map."""
    rng = np.random.default_rng(4)
    xmin, xmax, ymin, ymax = terrain.bounds
    return rng.uniform([xmin, ymin, -np.pi], [xmax, ymax, np.pi], (*shape, 3))


@pytest.mark.parametrize("ground", [rocky, gap])
@pytest.mark.parametrize("shape", [(5, 8), (60, 50)])
def test_scores_are_those_of_a_sweep_on_one_thread_and_on_several(ground, shape):
    terrain = make_terrain(ground)
    poses = poses_on(terrain, shape)
    scores = score_poses(ROVER, terrain, poses, SweepOptions(friction=0.5))
    path = judge_path(ROVER, terrain, poses.reshape(-1, 3), SweepOptions(friction=0.5))[0]
    expected = {
        "status": path.status,
        "friction_utilisation": path.friction_utilisation.max(axis=1),
        "torque_saturation": path.torque_saturation.max(axis=1),
        "least_load": path.wheel_loads.min(axis=1),
        "tip_over_ratio": path.tip_over_ratio,
        "tilt": path.tilt,
        "belly_clearance": path.belly_clearance,
    }
    assert 0 < path.settled.sum() < path.settled.size
    for name, values in expected.items():
        found = getattr(scores, name)
        assert found.shape == shape
        np.testing.assert_allclose(found.ravel(), values, rtol=1e-6, atol=1e-7)


def test_what_is_within_limits_is_what_a_verdict_passes():
    terrain = make_terrain(rocky)
    poses = poses_on(terrain, (60,))
    within = score_poses(ROVER, terrain, poses).passable
    passed = [
        hold_against_limits(ROVER, judge_path(ROVER, terrain, pose[None])[0]).traversable
        for pose in poses
    ]
    assert within.tolist() == passed and 0 < sum(passed) < 60


def test_a_map_is_swept_cell_by_cell(monkeypatch):
    monkeypatch.setattr(map_sweep, "BATCH", 300)
    rng = np.random.default_rng(1)
    terrain = Terrain(rng.normal(0.0, 0.01, (31, 41)), 0.1, (-1.0, 2.0))
    parts = list(sweep_map(ROVER, terrain, headings=3))
    assert [first for first, _ in parts] == list(range(0, 31, 2))
    status = np.concatenate([scores.status for _, scores in parts])
    tilt = np.concatenate([scores.tilt for _, scores in parts])
    assert status.shape == (31, 41, 3) and tilt.dtype == np.float32
    pose = [-1.0 + 0.1 * 20, 2.0 + 0.1 * 15, 2.0 * np.pi / 3.0]
    np.testing.assert_allclose(tilt[15, 20, 1], score_poses(ROVER, terrain, pose).tilt, rtol=1e-6)
