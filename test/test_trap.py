"""Trapped: holes that a rover can drive into but neither on nor back out of."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.rover import load_rover
from rover_physics.terrain import Terrain
from rover_physics.trap import judge_path

RESOLUTION = 0.02
LSR1 = load_rover("lsr1")
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
    return judge_path(rover, ground, way(start, end), **arguments)[1]


def test_a_path_that_ends_in_a_hole_without_way_out_is_refused_as_trapped():
    verdict = verdict_on(hole(0.15), -1.6, 0.1)
    assert not verdict.traversable
    assert verdict.code == "trapped"
    assert "no way on" in verdict.reason
    assert "no way back" in verdict.reason
    assert way(-1.6, 0.1)[verdict.first_failure, 0] < 0.0
    assert verdict.codes[verdict.first_failure] == "trapped"


def test_a_path_that_passes_such_a_hole_is_refused_where_the_rover_goes_in():
    verdict = verdict_on(hole(0.15), -1.6, 1.6)
    assert verdict.code == "trapped"
    assert way(-1.6, 1.6)[verdict.first_failure, 0] < 0.0


@pytest.mark.parametrize("end", [0.1, 1.6])
def test_traction_control_gets_out_of_what_equal_torques_are_trapped_in(end):
    assert verdict_on(hole(0.15), -1.6, end, policy="optimal").traversable


@pytest.mark.parametrize("end", [0.1, 1.6])
def test_weak_motors_are_trapped_where_strong_ones_are_not(end):
    weak = verdict_on(hole(0.15), -1.6, end, policy="optimal", max_torque=0.5)
    assert weak.code == "trapped"
    assert "torque" in weak.reason


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_shallow_hole_traps_nobody(policy):
    assert verdict_on(hole(0.05), -1.6, 0.1, policy=policy).traversable


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_step_down_to_open_ground_is_no_trap(policy):
    """Back up may be impossible, but the way on is open."""
    assert verdict_on(edge(-0.15), -1.2, 1.2, policy=policy).traversable
    assert not verdict_on(edge(0.15), -1.2, 1.2, max_torque=0.5).traversable


def test_an_end_below_an_edge_before_the_map_ends_is_a_trap():
    """Nobody can say that the way on is open."""
    rising = verdict_on(edge(-0.15), -1.2, 2.4, max_torque=0.5)
    assert rising.code == "trapped"
    assert "off the map" in rising.reason


def test_a_drop_beyond_the_limit_is_refused_as_a_drop():
    verdict = verdict_on(edge(-0.15), -1.2, 1.2, rover=LSR1)
    assert verdict.code == "wheel_drop"


def test_ground_without_edges_is_judged_as_before():
    for policy in ("equal", "optimal"):
        assert verdict_on(edge(0.0), -1.2, 1.2, policy=policy).traversable
