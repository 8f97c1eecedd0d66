# SPDX-License-Identifier: Apache-2.0
"""Trapped: holes that a rover can drive into but neither on nor back out of."""

import resource
import time
from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_path
from support.rough_grounds import bowl
from support.rovers import LSR1

RESOLUTION = 0.02
DEEP_DROPS = replace(LSR1, limits=replace(LSR1.limits, wheel_drop=1.0))
X = np.tile(-3.0 + RESOLUTION * np.arange(301), (301, 1))


def edge(height: float) -> Terrain:
    """Return ground that changes by `height` [m] at x = 0."""
    step = height * np.clip(X / RESOLUTION + 0.5, 0.0, 1.0)
    return Terrain(step, RESOLUTION, (-3.0, -3.0))


def hole(depth: float, width: float = 1.6) -> Terrain:
    """Return ground with a hole across the way, `depth` and `width` [m], around x = 0."""
    inside = np.clip((0.5 * width - np.abs(X)) / RESOLUTION + 0.5, 0.0, 1.0)
    return Terrain(-depth * inside, RESOLUTION, (-3.0, -3.0))


def way(start: float, end: float) -> np.ndarray:
    x = np.arange(start, end, 0.01)
    return np.column_stack([x, 0.0 * x, 0.0 * x])


def verdict_on(ground: Terrain, start: float, end: float, rover=DEEP_DROPS, **arguments):
    return judge_path(rover, ground, way(start, end), SweepOptions(**arguments))[1]


@pytest.mark.parametrize("end", [0.1, 1.6])
def test_a_hole_without_way_out_is_refused_as_trapped_where_the_rover_goes_in(end):
    """Whether the path ends in it or would go on."""
    verdict = verdict_on(hole(0.15), -1.6, end)
    assert (verdict.traversable, verdict.code) == (False, "trapped")
    assert way(-1.6, end)[verdict.first_failure, 0] < 0.0
    assert verdict.codes[verdict.first_failure] == "trapped"
    if end < 0.5:
        assert "no way on" in verdict.reason and "no way back" in verdict.reason


def test_traction_control_gets_out_of_what_equal_torques_and_weak_motors_are_trapped_in():
    assert verdict_on(hole(0.15), -1.6, 0.1, policy="optimal").traversable
    weak = verdict_on(hole(0.15), -1.6, 0.1, policy="optimal", max_torque=0.5)
    assert weak.code == "trapped"
    assert "torque" in weak.reason


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_a_shallow_hole_traps_nobody(policy):
    assert verdict_on(hole(0.05), -1.6, 0.1, policy=policy).traversable


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_step_down_to_open_ground_is_no_trap(policy):
    """Back up may be impossible, but the way on is open."""
    assert verdict_on(edge(-0.15), -1.2, 1.2, policy=policy).traversable
    assert verdict_on(edge(-0.15), -1.2, 1.2, rover=LSR1).code == "wheel_drop"
    assert not verdict_on(edge(0.15), -1.2, 1.2, max_torque=0.5).traversable


def test_an_end_below_an_edge_before_the_map_ends_is_a_trap():
    """Nobody can say that the way on is open."""
    whole = edge(-0.15)
    ground = Terrain(whole.elevation[:, :231], RESOLUTION, whole.origin)
    verdict = verdict_on(ground, -1.2, 1.0, max_torque=0.5)
    assert verdict.code == "trapped"
    assert "off the map" in verdict.reason
    assert verdict_on(whole, -1.2, 1.0, max_torque=0.5).traversable


def verdict_in(ground: Terrain, start: float, end: float, **arguments):
    x = np.arange(start, end, 0.04)
    poses = np.column_stack([x, 0.0 * x, 0.0 * x])
    return judge_path(LSR1, ground, poses, SweepOptions(**arguments))[1]


CRATER = bowl(0.7, 1.2, np.radians(18.0))


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_a_crater_of_soft_soil_is_a_trap_that_has_no_edges(policy):
    """Down its walls the soil brakes the rover, up any of them the soil holds it too."""
    ending = verdict_in(CRATER, -5.0, 0.0, soil="dry_sand", policy=policy)
    passing = verdict_in(CRATER, -5.0, 5.0, soil="dry_sand", policy=policy)
    for verdict in (ending, passing):
        assert verdict.code == "trapped"
        assert "no way on" in verdict.reason and "no way back" in verdict.reason
        assert -5.0 + 0.04 * verdict.first_failure < -1.0


def test_down_a_sandy_slope_to_a_wall_there_is_a_way_round_it():
    x = np.tile(np.arange(-6.0, 6.001, 0.05), (241, 1))
    ramp = np.clip(-x * np.tan(0.3), 0.0, 0.7)
    wall = Terrain(np.where(x > 3.0, 1.0, ramp), 0.05, (-6.0, -6.0))
    verdict = verdict_in(wall, -4.5, 3.0, soil="dry_sand")
    assert verdict.code not in ("", "trapped")
    assert verdict_in(wall, -4.5, 1.4, soil="dry_sand").traversable


def test_poses_close_together_before_an_edge_do_not_take_the_time_and_the_memory(close=1e-12):
    x = 0.05 * np.arange(120) - 3.0
    heights = np.where(x < 0.5, 0.0, -0.09) + np.where(x > 1.6, 0.5, 0.0)
    edge = Terrain(np.tile(heights, (120, 1)), 0.05, (-3.0, -3.0))
    way = np.concatenate([-1.0 + close * np.arange(100), np.arange(-0.98, 0.7, 0.02)])
    poses = np.column_stack([way, 0.0 * way, 0.0 * way])
    slippery = SweepOptions(friction=0.4)
    judge_path(LSR1, edge, poses, slippery)
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
    verdict = judge_path(LSR1, edge, poses, slippery)[1]
    assert verdict.code == "trapped"
    assert time.perf_counter() - began < 60.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB
