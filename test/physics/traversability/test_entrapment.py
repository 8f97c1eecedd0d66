# SPDX-License-Identifier: Apache-2.0
"""Trapped: holes that a rover can drive into but neither on nor back out of."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, judge_path
from rover_physics.traversability.entrapment import count_steps
from support.grounds import bowl, make_terrain
from support.paths import poses_at
from support.reference_drives import drive_ground
from support.rovers import LSR1

DEEP_DROPS = replace(LSR1, limits=replace(LSR1.limits, wheel_drop=1.0))
DOWN, UP = drive_ground("step", -0.15), drive_ground("step", 0.15)
HOLE = drive_ground("ditch", 1.6)
"""Ground with a hole of 1.6 m across the way, 15 cm deep, around x = 0."""
SHALLOW = replace(HOLE, elevation=HOLE.elevation / 3.0)


def verdict_on(ground, start, end, rover=DEEP_DROPS, spacing=0.01, **arguments):
    poses = poses_at(np.arange(start, end, spacing))
    return judge_path(rover, ground, poses, SweepOptions(**arguments))[1]


@pytest.mark.parametrize("end", [0.1, 1.6])
def test_a_hole_without_way_out_is_refused_as_trapped_where_the_rover_goes_in(end):
    """Whether the path ends in it or would go on."""
    verdict = verdict_on(HOLE, -1.6, end)
    assert (verdict.traversable, verdict.code) == (False, "trapped")
    assert -1.6 + 0.01 * verdict.first_failure < 0.0
    assert verdict.codes[verdict.first_failure] == "trapped"
    if end < 0.5:
        assert "no way on" in verdict.reason and "no way back" in verdict.reason


def test_traction_control_gets_out_of_what_equal_torques_and_weak_motors_are_trapped_in():
    assert verdict_on(HOLE, -1.6, 0.1, policy="optimal").traversable
    weak = verdict_on(HOLE, -1.6, 0.1, policy="optimal", max_torque=0.5)
    assert weak.code == "trapped"
    assert "torque" in weak.reason


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_a_shallow_hole_and_a_step_down_to_open_ground_are_no_traps(policy):
    """Back up the step may be impossible, but the way on is open."""
    assert verdict_on(SHALLOW, -1.6, 0.1, policy=policy).traversable
    assert verdict_on(DOWN, -1.2, 1.2, policy=policy).traversable
    assert not verdict_on(UP, -1.2, 1.2, max_torque=0.5).traversable


@pytest.mark.parametrize("backward", [False, True])
def test_a_rover_driven_tail_first_goes_on_tail_first_whether_or_not_the_options_say_so(backward):
    def tail_first(ground, end, **arguments):
        poses = poses_at(np.arange(-1.6, end, 0.01), yaw=np.pi)
        options = SweepOptions(backward=backward, **arguments)
        return judge_path(DEEP_DROPS, ground, poses, options)[1]

    assert tail_first(HOLE, 0.1).code == "trapped"
    assert tail_first(DOWN, 0.6, max_torque=0.5).traversable


def test_an_end_below_an_edge_before_the_map_ends_is_a_trap():
    """Nobody can say that the way on is open."""
    ground = replace(DOWN, elevation=DOWN.elevation[:, :231])
    verdict = verdict_on(ground, -1.2, 1.0, max_torque=0.5)
    assert verdict.code == "trapped"
    assert "off the map" in verdict.reason
    assert verdict_on(DOWN, -1.2, 1.0, max_torque=0.5).traversable


CRATER = bowl(0.7, 1.2, np.radians(18.0))


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_a_crater_of_soft_soil_is_a_trap_that_has_no_edges(policy):
    """Down its walls the soil brakes the rover, up any of them the soil holds it too."""
    for end in (0.0, 5.0):  # within it and beyond
        verdict = verdict_on(CRATER, -5.0, end, LSR1, 0.04, soil="dry_sand", policy=policy)
        assert verdict.code == "trapped"
        assert "no way on" in verdict.reason and "no way back" in verdict.reason
        assert -5.0 + 0.04 * verdict.first_failure < -1.0


def test_down_a_sandy_slope_to_a_wall_there_is_a_way_round_it():
    def ramp_and_wall(x, y):
        return np.where(x > 3.0, 1.0, np.clip(-x * np.tan(0.3), 0.0, 0.7))

    ground = make_terrain(ramp_and_wall, half=6.0)
    verdict = verdict_on(ground, -4.5, 3.0, LSR1, 0.04, soil="dry_sand")
    assert verdict.code not in ("", "trapped")
    assert verdict_on(ground, -4.5, 1.4, LSR1, 0.04, soil="dry_sand").traversable


def test_ways_on_of_poses_close_together_have_no_more_poses_than_usual(close=1e-12):
    poses = poses_at([*(-1.0 + close * np.arange(100)), *np.arange(-0.98, 0.7, 0.02)])
    assert count_steps(poses, 1.2, 0.1) == 60
