# SPDX-License-Identifier: Apache-2.0
"""A path that is swept up to its first failure gets the verdict of the whole path."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.prediction import sweep
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_kernels import Crossings
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import QUANTITIES, new_results
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path, judge_paths
from rover_physics.traversability.verdict import Verdict, hold_against_limits
from support.rough_grounds import bouldered, fractal, rocky

ROVER = load_rover("lsr1")
OPTIONS = {
    "equal": SweepOptions(),
    "slippery": SweepOptions(friction=0.35),
    "sand": SweepOptions(soil="dry_sand"),
    "backward": SweepOptions(friction=0.5, backward=True),
    "margin": SweepOptions(policy="optimal", control_margin=0.2, friction=0.45),
}


def straight(x: float, y: float, length: float, yaw: float, spacing: float) -> np.ndarray:
    """Return poses (n, 3) on a straight line with its middle at x, y."""
    along = np.arange(-0.5 * length, 0.5 * length, spacing)
    return np.column_stack([x + along * np.cos(yaw), y + along * np.sin(yaw), 0.0 * along + yaw])


@st.composite
def courses(draw) -> tuple[Terrain, np.ndarray]:
    """Return a rough ground, perhaps inclined or with unknown cells, and a path on it."""
    seed = draw(st.integers(0, 10_000))
    make = draw(st.sampled_from((bouldered, rocky, fractal)))
    ground = make(seed)
    rows, columns = np.mgrid[: ground.elevation.shape[0], : ground.elevation.shape[1]]
    rise = ground.elevation + ground.resolution * draw(st.floats(-0.5, 0.5)) * columns
    hole = draw(st.booleans()) & (np.hypot(rows - 40, columns - 90) < 6)
    ground = replace(ground, elevation=np.where(hole, np.nan, rise))
    places = st.floats(-0.7, 0.7)
    length, spacing = draw(st.floats(0.5, 3.9)), draw(st.sampled_from((0.01, 0.02, 0.05, 0.11)))
    yaw = draw(st.floats(-np.pi, np.pi))
    return ground, straight(draw(places), draw(places), length, yaw, spacing)


def first_refusal(verdict: Verdict) -> tuple:
    return verdict.traversable, verdict.first_failure, verdict.code, verdict.reason


def assert_same(one: PathPrediction, other: PathPrediction) -> None:
    for name in ("poses", "waypoint", "status", *(each.name for each in QUANTITIES)):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@settings(max_examples=30, deadline=None)
@given(courses(), st.sampled_from(sorted(OPTIONS)))
def test_a_stopped_sweep_is_the_beginning_of_the_whole_one_to_the_last_bit(course, option):
    ground, poses = course
    whole = judge_path(ROVER, ground, poses, OPTIONS[option])[0]
    verdict = hold_against_limits(ROVER, whole)
    model = pack_model(ROVER, ground, OPTIONS[option])
    swept = sweep.predict_paths(model, [poses], stop_at_failure=True)[0]
    stopped = hold_against_limits(ROVER, swept.prediction)
    assert first_refusal(stopped) == first_refusal(verdict)
    count = len(poses) if verdict.traversable else verdict.first_failure + 1
    assert len(swept.prediction.poses) == count
    assert_same(swept.prediction, whole.cut(count))
    assert_same(swept.prediction.between, whole.cut(count).between)
    assert stopped.codes == verdict.codes[:count]


def test_a_wheel_on_its_way_off_an_edge_at_the_end_of_a_block_is_no_failure(monkeypatch):
    """A sweep that took the end of a block for that of the path would refuse the fall."""
    ground = bouldered(3, half=6.0, count=600)
    poses = straight(0.0, -3.0, 9.0, 0.0, 0.02)
    _, whole = judge_path(ROVER, ground, poses)
    assert whole.traversable and whole.max_wheel_drop > 0.0
    for block in (1, 2, 3, 5, 7, 11):
        monkeypatch.setattr(sweep, "FIRST_BLOCK", block)
        assert judge_path(ROVER, ground, poses, stop_at_failure=True)[1].traversable


def test_several_paths_stop_each_at_its_own_failure():
    ground = bouldered(3, half=6.0, count=600)
    paths = [straight(0.0, y, length, 0.0, 0.02) for y in (-3.0, -1.0, 3.0) for length in (4, 9)]
    options = SweepOptions(friction=0.5)
    together = judge_paths(ROVER, ground, paths, options, stop_at_failure=True)
    for path, (prediction, verdict) in zip(paths, together, strict=True):
        alone, own = judge_path(ROVER, ground, path, options, stop_at_failure=True)
        assert first_refusal(verdict) == first_refusal(own)
        assert_same(prediction, alone)
    assert len({verdict.first_failure for _, verdict in together}) > 2


def test_nothing_is_evaluated_or_searched_far_beyond_a_failure_at_the_start(monkeypatch):
    ground = bouldered(3, half=6.0, count=600)
    unknown = np.where(np.arange(ground.elevation.shape[1]) < 60, np.nan, ground.elevation)
    poses = straight(0.0, -3.0, 9.0, 0.0, 0.02)
    evaluated = []
    evaluate = PackedModel.evaluate

    def counting(model, at, *held, **motions):
        evaluated.append(len(at))
        return evaluate(model, at, *held, **motions)

    monkeypatch.setattr(PackedModel, "evaluate", counting)
    _, verdict = judge_path(ROVER, replace(ground, elevation=unknown), poses, stop_at_failure=True)
    assert verdict.first_failure == 0
    assert sum(evaluated) == sweep.FIRST_BLOCK


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_bounds_refuse_the_same_waypoint_with_and_without_stopping(policy):
    ground = bouldered(3, half=6.0, count=600)
    ground = replace(ground, elevation_std=np.full_like(ground.elevation, 0.004))
    poses = straight(0.0, -3.0, 3.0, 0.0, 0.05)
    options = SweepOptions(policy=policy, friction=0.6)
    whole, verdict = judge_path(ROVER, ground, poses, options)
    cut, stopped = judge_path(ROVER, ground, poses, options, stop_at_failure=True)
    assert first_refusal(stopped) == first_refusal(verdict)
    np.testing.assert_array_equal(cut.bounds.status, whole.bounds.status[: len(cut.poses)])


def test_crossings_end_where_a_stretch_ends():
    """Rows of a stretch that ends at a waypoint come before those of the next one."""
    tied = Crossings(
        np.ones(2), np.array([2, 1]), np.ones(2, bool), np.zeros((2, 3)), new_results(2)
    )
    assert tied.in_order().waypoint.tolist() == [1, 2]
