# SPDX-License-Identifier: Apache-2.0
"""A long path that is judged in parts gets the verdict and the prediction of the whole path."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.bounds.path import BOUNDED_VALUES
from rover_physics.prediction import sweep
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.record import QUANTITIES
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.partwise import PartwiseJudge
from support.rough_grounds import bouldered

ROVER = load_rover("lsr1")
GROUND = bouldered(3, half=6.0, count=600)


def line(y: float = -3.0, length: float = 9.0) -> np.ndarray:
    """Return poses (n, 3) along x, 2 cm apart."""
    x = np.arange(-0.5 * length, 0.5 * length, 0.02)
    return np.column_stack([x, np.full_like(x, y), np.zeros_like(x)])


def inclined(slope: float) -> Terrain:
    columns = np.arange(GROUND.elevation.shape[1]) * GROUND.resolution
    return replace(GROUND, elevation=GROUND.elevation + slope * columns)


def steps_down(step: float) -> Terrain:
    """Return stairs down along x, 0.4 m from edge to edge, so that wheels fall again and again."""
    x = np.arange(-6.0, 6.001, 0.04)
    heights = -step * np.floor(np.clip(x + 4.0, 0.0, None) / 0.4)
    return Terrain(np.tile(heights, (len(x), 1)), 0.04, (-6.0, -6.0))


def unknown(start: float) -> Terrain:
    hidden = np.arange(GROUND.elevation.shape[1]) * GROUND.resolution > start
    return replace(GROUND, elevation=np.where(hidden, np.nan, GROUND.elevation))


CASES = {
    "rocks": (GROUND, line(), SweepOptions()),
    "uphill": (inclined(0.2), line(), SweepOptions()),
    "downhill": (inclined(-0.25), line(1.0), SweepOptions(friction=0.8)),
    "backwards down": (inclined(0.2), line()[::-1].copy(), SweepOptions(backward=True)),
    "slippery": (GROUND, line(-1.0), SweepOptions(friction=0.4)),
    "sand": (GROUND, line(3.0), SweepOptions(soil="dry_sand")),
    "margin": (GROUND, line(3.0), SweepOptions("optimal", control_margin=0.3, friction=0.5)),
    "stairs": (steps_down(0.03), line(0.0), SweepOptions(friction=0.9)),
    "high stairs": (steps_down(0.05), line(0.0), SweepOptions("optimal", friction=0.9)),
    "ledges": (steps_down(0.16), line(0.0), SweepOptions()),
    "unknown ground": (unknown(8.0), line(), SweepOptions()),
    "unknown from the start": (unknown(0.0), line(), SweepOptions()),
}


def judge_in_parts(terrain, poses, options, **more):
    """Return the predictions of all parts, and the verdict."""
    judge = PartwiseJudge(ROVER, terrain, poses, options, **more)
    taken = list(judge.parts())
    return taken, judge.verdict()


def assert_same(whole: PathPrediction, taken: list[PathPrediction]) -> None:
    for name in ("poses", "status", *(one.name for one in QUANTITIES)):
        found = np.concatenate([getattr(part, name) for part in taken])
        np.testing.assert_array_equal(found, getattr(whole, name), err_msg=name)


@pytest.mark.parametrize("case", CASES)
def test_all_numbers_and_the_verdict_are_those_of_the_whole_path(case, monkeypatch):
    monkeypatch.setattr(sweep, "PART", 17)
    terrain, poses, options = CASES[case]
    whole, verdict = judge_path(ROVER, terrain, poses, options)
    taken, found = judge_in_parts(terrain, poses, options)
    assert_same(whole, taken)
    assert found.to_dict() == verdict.to_dict()


def test_bounds_are_those_of_the_whole_path(monkeypatch):
    monkeypatch.setattr(sweep, "PART", 16)
    ground = replace(GROUND, elevation_std=np.full_like(GROUND.elevation, 0.003))
    options, poses = SweepOptions(friction=0.7), line(length=2.0)
    whole, verdict = judge_path(ROVER, ground, poses, options, sigmas=2.0)
    taken, found = judge_in_parts(ground, poses, options, sigmas=2.0)
    assert found.to_dict() == verdict.to_dict()
    for name in BOUNDED_VALUES:
        bounds = np.concatenate([getattr(part.bounds, name) for part in taken])
        np.testing.assert_array_equal(bounds, getattr(whole.bounds, name))


def test_a_trap_at_the_end_of_a_long_path_is_found(monkeypatch):
    monkeypatch.setattr(sweep, "PART", 32)
    x, y = np.meshgrid(np.arange(-6.0, 6.001, 0.05), np.arange(-6.0, 6.001, 0.05))
    radius = np.hypot(x, y)
    bowl = Terrain(np.clip(radius - 1.5, 0.0, 1.0) * np.tan(0.35), 0.05, (-6.0, -6.0))
    poses = line(0.0, 10.0)[:250]
    options = SweepOptions(soil="dry_sand")
    _, verdict = judge_path(ROVER, bowl, poses, options)
    _, found = judge_in_parts(bowl, poses, options)
    assert verdict.code == "trapped"
    assert found.to_dict() == verdict.to_dict()


def test_no_part_is_much_longer_than_asked_even_where_nothing_settles(monkeypatch):
    monkeypatch.setattr(sweep, "PART", 50)
    taken, verdict = judge_in_parts(unknown(0.0), line(), SweepOptions())
    assert verdict.code == "unknown_ground"
    assert max(len(part.poses) for part in taken) <= 50
