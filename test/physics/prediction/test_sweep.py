# SPDX-License-Identifier: Apache-2.0
"""Sweeps: bad arguments, waypoints on their own, time and energy, scores, several at once."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rover_physics.prediction.map_sweep as map_sweep
from rover_physics import (
    PoseStatus,
    SweepOptions,
    Terrain,
    judge_path,
    judge_paths,
    score_poses,
    sweep_map,
)
from rover_physics.errors import ModelError, PoseError, RoverError
from rover_physics.numerics import interruption
from rover_physics.numerics.interruption import interruptible
from rover_physics.results.record import QUANTITIES
from rover_physics.traversability.verdict import hold_against_limits
from support.grounds import (
    gap,
    make_terrain,
    plane,
    random_poses,
    rocky,
    scaled_for,
    waves,
    with_std,
)
from support.paths import poses_at
from support.predictions import assert_same
from support.rover_geometry import place_rover
from support.rovers import LSR1, M2020

LEVEL = plane(0.0, 0.0)
NAN, INF = float("nan"), float("inf")


def line(start: float, end: float, count: int = 41) -> np.ndarray:
    """Return a straight path along x."""
    return poses_at(np.linspace(start, end, count))


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ([0.0, 0.0, 0.0], r"shape \(3,\).*\(n, 3\)"),
        (np.zeros((0, 3)), r"shape \(0, 3\).*n >= 1"),
        ([[0.0, 0.0, 0.0], [0.0, NAN, 0.0]], r"y of pose 1 is nan.*finite"),
        ([[INF, 0.0, 0.0]], r"x of pose 0 is inf.*finite"),
        ([[0.0, 0.0, 0.0], [0.0, 0.0]], "not numbers"),
        (None, "poses"),
    ],
)
def test_bad_poses_are_refused_by_what_is_wrong_with_them(poses, words):
    with pytest.raises(PoseError, match=words):
        judge_path(LSR1, LEVEL, poses)[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"policy": "best"}, "'best'.*equal, servo, optimal"),
        ({"friction": 0.0}, r"friction is 0.0.*above 0"),
        ({"friction": "a"}, r"friction is 'a'; it must be a number"),
        ({"policy": ["equal"]}, r"policy is \['equal'\]; it must be a name"),
        ({"joint_angles": 0.5}, r"joint_angles is 0.5; it must be numbers by joint name"),
        ({"joint_angles": {"arm_yaw": "a"}}, r"joint_angles is .*; it must be numbers by"),
        ({"max_torque": NAN}, r"max_torque is nan.*above 0"),
        ({"soil": "dry_sad"}, "no soil 'dry_sad'; did you mean dry_sand. soils are firm_"),
    ],
)
def test_bad_arguments_are_refused_by_name_and_value(arguments, words):
    with pytest.raises(RoverError, match=words):
        judge_path(LSR1, LEVEL, [[0.0, 0.0, 0.0]], SweepOptions(**arguments))[0]


@settings(max_examples=8)
@given(st.integers(0, 10_000), st.integers(1, 70))
def test_any_choice_of_poses_gives_identical_rows(seed, count):
    ground, poses = rocky(1), random_poses(1, 70, 2.6)
    rows = np.random.default_rng(seed).choice(70, count, replace=False)
    everything = judge_path(LSR1, ground, poses)[0]
    chosen = judge_path(LSR1, ground, poses[rows])[0]
    for name in ("status", *(one.name for one in QUANTITIES if not one.of_path)):
        assert chosen.results[name].tobytes() == everything.results[name][rows].tobytes(), name
    assert (everything.status == PoseStatus.SETTLED).any()
    assert (everything.status == PoseStatus.OFF_MAP).any()


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_paths_swept_together_are_as_swept_one_by_one(policy):
    ground = rocky(3)
    paths = [random_poses(1, 1, 1.0), line(-1.0, 1.0, 101), line(1.0, -1.0, 60), line(9.0, 9.1, 4)]
    together = [one for one, _ in judge_paths(LSR1, ground, paths, SweepOptions(policy=policy))]
    assert sum(len(prediction.between.poses) for prediction in together) > 20
    for poses, prediction in zip(paths, together, strict=True):
        alone = judge_path(LSR1, ground, poses, SweepOptions(policy=policy))[0]
        assert_same(prediction, alone)
        assert_same(prediction.between, alone.between)


def test_uphill_time_is_that_of_the_way_and_distance_that_on_the_map():
    up = judge_path(LSR1, plane(0.3, 0.0), line(-0.3, 0.3))[0]
    assert up.time[0] == 0.0 and up.distance[-1] == pytest.approx(0.6)
    way = 0.6 * np.hypot(1.0, 0.3)
    assert up.time[-1] == pytest.approx(way / LSR1.nominal_speed, rel=1e-4)


@pytest.mark.parametrize("policy", ["equal", "optimal"])
@pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)
@pytest.mark.parametrize(
    "height",
    [
        lambda x, y: 0.03 * np.log1p(np.exp(x / 0.1)),
        lambda x, y: 0.2 * x + 0.08 * np.sin(3.0 * x),
        lambda x, y: 0.1 * np.exp(-((x / 0.3) ** 2)),
    ],
    ids=["ramp", "waves", "bump"],
)
def test_a_way_costs_more_than_the_way_back_by_the_weight_that_it_lifts(height, rover, policy):
    """Without slip nothing is lost; braking wheels of the one way drive on the other."""
    ground, path = scaled_for(rover, make_terrain(height, 0.02, 1.6), line(-0.8, 0.8, 161))
    options = SweepOptions(policy, friction=2.0, max_torque=1e5)
    way = judge_path(rover, ground, path, options)[0]
    back = judge_path(rover, ground, path[::-1], replace(options, backward=True))[0]
    spent = way.energy[-1], back.energy[-1]
    parts = [place_rover(rover, way, i).masses for i in (0, -1)]
    start, end = (sum(mass * place[2] for mass, place, *_ in some) for some in parts)
    lifted = rover.gravity * (end - start)
    assert spent[0] - spent[1] == pytest.approx(lifted, abs=0.005 * sum(spent))


@pytest.mark.parametrize(("ground", "shape"), [(waves, (5, 8)), (gap, (60, 50))])
def test_scores_are_those_of_a_sweep_and_its_verdict_on_one_thread_and_on_several(ground, shape):
    terrain = make_terrain(ground)
    (xmin, xmax, ymin, ymax), rng = terrain.bounds, np.random.default_rng(4)
    poses = rng.uniform([xmin, ymin, -np.pi], [xmax, ymax, np.pi], (*shape, 3))
    scores = score_poses(LSR1, terrain, poses, SweepOptions(friction=0.5))
    path = judge_path(LSR1, terrain, poses.reshape(-1, 3), SweepOptions(friction=0.5))[0]
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
    passed = [not code for code in hold_against_limits(LSR1, path).codes]
    assert scores.passable.ravel().tolist() == passed and 0 < sum(passed) < len(passed)


def test_a_map_is_swept_cell_by_cell_at_one_heading_or_more(monkeypatch):
    monkeypatch.setattr(map_sweep, "BATCH", 300)
    rng = np.random.default_rng(1)
    terrain = Terrain(rng.normal(0.0, 0.01, (31, 41)), 0.1, (-1.0, 2.0))
    parts = list(sweep_map(LSR1, terrain, headings=3))
    assert [first for first, _ in parts] == list(range(0, 31, 2))
    status = np.concatenate([scores.status for _, scores in parts])
    tilt = np.concatenate([scores.tilt for _, scores in parts])
    assert status.shape == (31, 41, 3) and tilt.dtype == np.float32
    pose = [-1.0 + 0.1 * 20, 2.0 + 0.1 * 15, 2.0 * np.pi / 3.0]
    np.testing.assert_allclose(tilt[15, 20, 1], score_poses(LSR1, terrain, pose).tilt, rtol=1e-6)
    with pytest.raises(ModelError, match="headings is 0; it must be"):
        next(sweep_map(LSR1, terrain, headings=0))


def test_sweeps_at_once_have_the_bits_of_sweeps_alone():
    exact, poses = rocky(0), line(-2.5, 2.5, 60) + poses_at(0.0, -0.5)
    asked = [
        (terrain, poses, SweepOptions(policy=policy))
        for terrain in (exact, with_std(exact, 0.002))
        for policy in ("equal", "optimal")
    ]
    alone = [judge_path(LSR1, *one) for one in asked]
    with ThreadPoolExecutor(len(asked)) as pool:
        found = list(pool.map(lambda one: judge_path(LSR1, *one), asked * 2))
    for (prediction, verdict), (other, other_verdict) in zip(alone * 2, found, strict=True):
        assert other_verdict.codes == verdict.codes
        assert_same(other, prediction)


def test_a_check_that_raises_ends_the_sweep_and_the_next_one_runs():
    ground, poses = make_terrain(waves), line(-1.5, 1.5, 2000)
    check = Mock(side_effect=[None, InterruptedError])
    with pytest.raises(InterruptedError), interruptible(check):
        judge_path(LSR1, ground, poses)
    assert judge_path(LSR1, ground, poses)[0].settled.all()


def test_slices_change_no_bit_of_a_prediction_or_its_bounds(monkeypatch):
    ground, poses = with_std(make_terrain(waves), 0.002), line(-1.5, 1.5, 60)
    whole = judge_path(LSR1, ground, poses)[0]
    monkeypatch.setattr(interruption, "FIRST_SLICE", 7)
    monkeypatch.setattr(interruption, "MAX_GROWTH", 1.0)
    with interruptible(lambda: None):
        parts = judge_path(LSR1, ground, poses)[0]
    assert_same(parts, whole)
    for name in ("roll", "wheel_loads", "belly_clearance"):
        np.testing.assert_array_equal(getattr(parts.bounds, name), getattr(whole.bounds, name))
