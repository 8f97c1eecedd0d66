# SPDX-License-Identifier: Apache-2.0
"""Trapped: holes that a rover can drive into but neither on nor back out of."""

import resource
import time
from dataclasses import replace

import numpy as np
import pytest

from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability import entrapment as trap
from rover_physics.traversability.judge import judge_path

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
    return judge_path(rover, ground, way(start, end), SweepOptions(**arguments))[1]


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
    whole = edge(-0.15)
    ground = Terrain(whole.elevation[:, :231], RESOLUTION, whole.origin)
    verdict = verdict_on(ground, -1.2, 1.0, max_torque=0.5)
    assert verdict.code == "trapped"
    assert "off the map" in verdict.reason
    assert verdict_on(whole, -1.2, 1.0, max_torque=0.5).traversable


def test_a_drop_beyond_the_limit_is_refused_as_a_drop():
    verdict = verdict_on(edge(-0.15), -1.2, 1.2, rover=LSR1)
    assert verdict.code == "wheel_drop"


def bowl(depth: float, floor: float, slope: float, reach: float = 6.0) -> Terrain:
    """Return a round crater: a level floor of radius `floor` [m], then walls of `slope` [rad]."""
    axis = np.arange(-reach, reach + 0.5 * 0.05, 0.05)
    away = np.hypot(*np.meshgrid(axis, axis))
    height = np.clip((away - floor) * np.tan(slope), 0.0, depth)
    return Terrain(height, 0.05, (-reach, -reach))


def verdict_in(ground: Terrain, start: float, end: float, **arguments):
    x = np.arange(start, end, 0.04)
    poses = np.column_stack([x, 0.0 * x, 0.0 * x])
    return judge_path(LSR1, ground, poses, SweepOptions(**arguments))[1]


CRATER = bowl(0.7, 1.2, np.radians(18.0))


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_crater_of_soft_soil_is_a_trap_that_has_no_edges(policy):
    """Down its walls the soil brakes the rover, up any of them the soil holds it too."""
    ending = verdict_in(CRATER, -5.0, 0.0, soil="dry_sand", policy=policy)
    passing = verdict_in(CRATER, -5.0, 5.0, soil="dry_sand", policy=policy)
    for verdict in (ending, passing):
        assert verdict.code == "trapped"
        assert "no way on" in verdict.reason
        assert "no way back" in verdict.reason
        assert -5.0 + 0.04 * verdict.first_failure < -1.0


def test_down_a_sandy_slope_to_a_wall_there_is_a_way_round_it():
    x = np.tile(np.arange(-6.0, 6.001, 0.05), (241, 1))
    ramp = np.clip(-x * np.tan(0.3), 0.0, 0.7)
    wall = Terrain(np.where(x > 3.0, 1.0, ramp), 0.05, (-6.0, -6.0))
    verdict = verdict_in(wall, -4.5, 3.0, soil="dry_sand")
    assert not verdict.traversable
    assert verdict.code != "trapped"
    assert verdict_in(wall, -4.5, 1.4, soil="dry_sand").traversable


@pytest.mark.parametrize("soil", [None, "dry_sand"])
def test_an_obstacle_ahead_on_level_ground_is_no_trap(soil):
    x = np.tile(np.arange(-6.0, 6.001, 0.05), (241, 1))
    wall = Terrain(np.where(x > 2.0, 1.0, 0.0), 0.05, (-6.0, -6.0))
    verdict = verdict_in(wall, -2.0, 3.0, soil=soil)
    assert not verdict.traversable
    assert verdict.code != "trapped"


def test_backwards_into_a_crater_is_as_much_a_trap():
    x = np.arange(-5.0, 0.0, 0.04)
    poses = np.column_stack([x, 0.0 * x, np.full(len(x), np.pi)])
    verdict = judge_path(LSR1, CRATER, poses, SweepOptions(soil="dry_sand", backward=True))[1]
    assert verdict.code == "trapped"


def test_on_coulomb_ground_without_drops_nothing_more_is_swept(monkeypatch):
    asked = []
    for name in ("predict_paths", "predict_way_back"):
        sweep = getattr(trap, name)
        monkeypatch.setattr(
            trap,
            name,
            lambda *given, sweep=sweep, **more: asked.append(given) or sweep(*given, **more),
        )
    assert verdict_in(CRATER, -5.0, 5.0).traversable
    assert verdict_in(edge(0.0), -2.0, 2.0, soil="dry_sand").traversable
    assert not asked
    assert verdict_in(CRATER, -5.0, 0.0, soil="dry_sand").code == "trapped"
    assert asked


def test_forces_at_rest_are_the_same_both_ways_on_coulomb_ground():
    x = np.arange(-5.0, 5.0, 0.1)
    poses = np.column_stack([x, 0.0 * x, 0.0 * x])
    there, back = (
        judge_path(LSR1, CRATER, path, SweepOptions(backward=backward))[0]
        for path, backward in ((poses, False), (poses[::-1], True))
    )
    np.testing.assert_allclose(back.wheel_loads[::-1], there.wheel_loads, atol=1e-9)
    np.testing.assert_allclose(back.tangential[::-1], there.tangential, atol=1e-9)
    np.testing.assert_allclose(back.torque[::-1], there.torque, atol=1e-9)


@pytest.mark.parametrize("close", [1e-6, 1e-12])
def test_poses_close_together_before_an_edge_do_not_take_the_time_and_the_memory(close):
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


# Speed servos


def test_ways_of_speed_servos_are_judged_by_their_own_tractions():
    """On fixed wheels, servos turn less than the way asks; equal tractions balance there."""
    fixed = replace(LSR1, steering=None)
    _, curve, _ = trap._paths_ahead(np.zeros(3), 0.8, np.linspace(0.0, 1.2, 61), 1.0)
    on_servos, level = SweepOptions(policy="servo"), edge(0.0)
    assert judge_path(fixed, level, curve)[1].traversable
    assert not judge_path(fixed, level, curve, on_servos)[1].traversable
    assert not trap._judge_escape(pack_model(fixed, level, on_servos), curve).traversable


@pytest.mark.parametrize("slope, checked", [(0.0, False), (-0.3, False), (-0.55, True)])
def test_the_way_back_of_speed_servos_is_checked_where_they_pull_hard(slope, checked):
    ground = Terrain(slope * X, RESOLUTION, (-3.0, -3.0))
    options = SweepOptions(policy="servo", friction=0.6)
    prediction = judge_path(LSR1, ground, way(-0.3, 0.3), options)[0]
    assert trap.find_irreversible(pack_model(LSR1, ground, options), prediction).any() == checked


@pytest.mark.parametrize("spacing", [0.03, 0.01 + 1e-12, 0.01 - 1e-12])
def test_ways_on_end_at_the_same_place_whatever_the_spacing(spacing):
    path = np.zeros((40, 3))
    path[:, 0] = spacing * np.arange(40)
    steps = trap.count_steps(path, 1.2)
    ahead = np.linspace(0.0, 1.2, steps + 1)
    ends = [ahead_path[-1] for ahead_path in trap._paths_ahead(path[0], 0.8, ahead, 1.0)]
    assert ends[0] == pytest.approx([1.2, 0.0, 0.0], abs=1e-12)
    assert 1.2 / steps <= spacing * (1.0 + 1e-6)
