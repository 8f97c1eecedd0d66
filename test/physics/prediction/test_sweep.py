# SPDX-License-Identifier: Apache-2.0
"""Sweep: bad arguments, waypoints that stand for themselves, time and energy, several callers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.errors import ModelError, PoseError
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.record import QUANTITIES
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.traversability.judge import judge_path, judge_paths
from support.rough_grounds import fractal, plane, random_poses, rocky

LSR1 = load_rover("lsr1")
LEVEL = plane(0.0, 0.0)
POSE = [[0.0, 0.0, 0.0]]
NAN, INF = float("nan"), float("inf")
GROWING = {"energy", "time", "distance"}
ALONG_THE_PATH = GROWING | {"wheel_drop", "falling", "between", "waypoint", "bounds"}
few = settings(max_examples=20, deadline=None)


def line(start: float, end: float, count: int = 41, yaw: float = 0.0) -> np.ndarray:
    """Return a straight path along x."""
    return np.column_stack([np.linspace(start, end, count), np.zeros(count), np.full(count, yaw)])


def columns(prediction):
    """Return the arrays of a prediction that hold a row per waypoint of its own, by name."""
    names = ["poses", "status", *(one.name for one in QUANTITIES if not one.of_path)]
    return {name: np.ascontiguousarray(getattr(prediction, name)) for name in names}


def assert_identical(prediction, expected, rows=slice(None)):
    for name, values in columns(prediction).items():
        assert values.tobytes() == columns(expected)[name][rows].tobytes(), name


# Bad input


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ([0.0, 0.0, 0.0], r"shape \(3,\).*\(n, 3\)"),
        (np.zeros((1, 2, 3)), r"shape \(1, 2, 3\).*\(n, 3\)"),
        (np.zeros((0, 3)), r"shape \(0, 3\).*n >= 1"),
        ([[0.0, 0.0, 0.0], [0.0, NAN, 0.0]], r"y of pose 1 is nan.*finite"),
        ([[INF, 0.0, 0.0]], r"x of pose 0 is inf.*finite"),
        ([[0.0, 0.0, -INF]], r"yaw of pose 0 is -inf.*finite"),
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
        ({"friction": INF}, r"friction is inf"),
        ({"max_torque": NAN}, r"max_torque is nan.*above 0"),
        ({"payload": -1.0}, r"payload is -1.0"),
        ({"joint_angles": {"arm_yaw": NAN}}, "arm_yaw"),
    ],
)
def test_bad_arguments_are_refused_by_name_and_value(arguments, words):
    with pytest.raises(ModelError, match=words):
        judge_path(LSR1, LEVEL, POSE, SweepOptions(**arguments))[0]


# What comes back


def test_the_poses_of_the_caller_are_left_alone():
    poses = np.asfortranarray(line(-0.2, 0.2))
    before = poses.copy()
    prediction = judge_path(LSR1, LEVEL, poses)[0]
    assert np.array_equal(poses, before)
    assert np.array_equal(prediction.poses, before)


def test_a_full_turn_of_the_heading_changes_nothing():
    poses = random_poses(4, 20, 2.0)
    here = judge_path(LSR1, fractal(4), poses)[0]
    there = judge_path(LSR1, fractal(4), poses + np.array([0.0, 0.0, 2.0 * np.pi]))[0]
    assert there.wheel_centres == pytest.approx(here.wheel_centres, abs=1e-5)


# Each waypoint on its own


@few
@given(st.integers(0, 10_000), st.integers(1, 70))
def test_any_choice_of_poses_gives_identical_rows(seed, count):
    ground, poses = rocky(1), random_poses(1, 70, 2.6)
    rows = np.random.default_rng(seed).choice(70, count, replace=False)
    everything = judge_path(LSR1, ground, poses)[0]
    chosen = judge_path(LSR1, ground, poses[rows])[0]
    assert_identical(chosen, everything, rows)
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
        for part, expected in ((prediction, alone), (prediction.between, alone.between)):
            assert_identical(part, expected)
            for name in sorted(ALONG_THE_PATH - {"between", "bounds"}):
                assert getattr(part, name).tobytes() == getattr(expected, name).tobytes(), name


def test_no_path_gives_no_prediction():
    assert [one for one, _ in judge_paths(LSR1, LEVEL, [])] == []


# Time, distance, energy


def test_time_is_the_way_at_nominal_speed():
    prediction = judge_path(LSR1, LEVEL, line(-0.3, 0.3))[0]
    assert prediction.time[0] == 0.0
    assert prediction.time[-1] == pytest.approx(0.6 / LSR1.nominal_speed)
    assert prediction.distance[-1] == pytest.approx(0.6)


def test_the_way_up_a_slope_takes_longer_than_its_shadow():
    prediction = judge_path(LSR1, plane(0.4, 0.0), line(-0.3, 0.3))[0]
    way = 0.6 * np.hypot(1.0, 0.4)
    assert prediction.time[-1] == pytest.approx(way / LSR1.nominal_speed, rel=1e-4)


def test_wheels_too_slow_for_the_nominal_speed_set_the_time():
    slow = replace(LSR1, wheel=replace(LSR1.wheel, max_speed=0.1))
    prediction = judge_path(slow, LEVEL, line(-0.3, 0.3))[0]
    assert prediction.time[-1] == pytest.approx(0.6 / (0.1 * 0.10))


def test_energy_uphill_is_the_weight_lifted():
    prediction = judge_path(LSR1, plane(0.3, 0.0), line(-0.3, 0.3), SweepOptions(friction=2.0))[0]
    lifted = LSR1.weight * np.ptp(prediction.position[:, 2])
    assert prediction.energy[0] == 0.0
    assert prediction.energy[-1] == pytest.approx(lifted, rel=1e-4)


def test_braking_downhill_gives_nothing_back():
    prediction = judge_path(LSR1, plane(-0.3, 0.0), line(-0.3, 0.3))[0]
    assert (prediction.torque < 0.0).all()
    assert prediction.energy[-1] == 0.0


@few
@given(st.integers(0, 19), st.floats(-np.pi, np.pi))
def test_energy_time_and_distance_never_fall(seed, yaw):
    steps = np.linspace(-1.5, 1.5, 60)[:, None]
    poses = np.hstack([steps * [np.cos(yaw), np.sin(yaw)], np.full((60, 1), yaw)])
    prediction = judge_path(LSR1, rocky(seed), poses)[0]
    for name in GROWING:
        values = getattr(prediction, name)
        values = values[~np.isnan(values)]
        assert values.size >= 50
        assert (np.diff(values) >= 0.0).all(), name
    assert (np.diff(prediction.time[prediction.settled]) > 0.0).all()
    assert (prediction.power[prediction.settled] >= 0.0).all()
