# SPDX-License-Identifier: Apache-2.0
"""What the planner calls passable with traction control is passed with it, and not without."""

import pytest

pytest.importorskip("mujoco", reason="no mujoco: pip install '.[bench]'")
from benchmarks.drives import BY_MAP, EQUAL_TORQUES, Obstacle, drive
from rover_physics import SweepOptions, judge_path, load_rover
from support.reference_drives import drive_path, unlimited

STEP = Obstacle("step", 0.10, 0.5)
"""As high as a wheel radius, at a friction with which equal torques do not do."""


@pytest.mark.long
@pytest.mark.parametrize(("controller", "passes"), [(EQUAL_TORQUES, False), (BY_MAP, True)])
def test_in_mujoco_the_step_is_passed_with_the_program_and_not_with_equal_torques(
    controller, passes
):
    assert drive(STEP, controller).passed is passes


@pytest.mark.long
def test_a_promise_is_kept_where_one_wheel_needs_nearly_all_its_torque():
    bump = Obstacle("bump_one_side", 0.113, friction=0.99, max_torque=0.903)
    asked = SweepOptions("optimal", friction=0.99, max_torque=0.903, control_margin=0.1)
    rover, path = unlimited(load_rover("lsr1")), drive_path()
    assert judge_path(rover, bump.ground, path, asked)[1].traversable
    assert drive(bump, BY_MAP, tries=3, most_time=5.0).passed


@pytest.mark.long
@pytest.mark.parametrize("timestep", [0.002, 0.003, 0.004])
def test_a_wheel_that_meets_a_wall_does_not_begin_to_slip_and_stick_by_turns(timestep):
    """With torques that rose within a tenth of a second no drive passed."""
    step = Obstacle("step", 0.2004, friction=0.716, max_torque=0.8416)
    assert drive(step, BY_MAP, tries=3, most_time=5.0, timestep=timestep).passed


@pytest.mark.long
def test_a_side_slope_near_the_friction_is_crossed():
    """Upper wheels seemed to slip, and the rover slid down by a metre."""
    slope = Obstacle("cross_slope", 28.6, friction=0.652, max_torque=2.17)
    assert drive(slope, BY_MAP, tries=3, most_time=5.0).passed


@pytest.mark.long
def test_a_rover_whose_wheels_turn_at_a_wall_is_helped_by_its_speed_servos():
    """While wheels hopped, the rover did not seem to be stalled, and stayed in the ditch."""
    ditch = Obstacle("ditch", 0.3827, friction=0.938, max_torque=1.9468)
    assert drive(ditch, BY_MAP, tries=3, most_time=5.0, timestep=0.003).passed
