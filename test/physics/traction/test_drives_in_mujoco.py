# SPDX-License-Identifier: Apache-2.0
"""What the planner calls passable with traction control is passed with it, and not without."""

import pytest

pytest.importorskip("mujoco", reason="no mujoco: pip install '.[bench]'")
from benchmarks.drives import BY_MAP, EQUAL_TORQUES, drive
from benchmarks.grounds import Obstacle
from rover_physics import SweepOptions, judge_path, load_rover
from rover_planner.simulator.mujoco_rover import TIMESTEP
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


WALL = Obstacle("step", 0.2004, friction=0.788, max_torque=0.8416)
"""With torques that rose within a tenth of a second wheels slipped and stuck by turns."""
SIDE_SLOPE = Obstacle("cross_slope", 28.6, friction=0.652, max_torque=2.17)
"""Upper wheels seemed to slip, and the rover slid down by a metre."""
DITCH = Obstacle("ditch", 0.3827, friction=0.938, max_torque=1.9468)
"""While wheels hopped, the rover did not seem to be stalled, and no speed servos helped it out."""


@pytest.mark.long
@pytest.mark.parametrize(
    ("obstacle", "timestep"),
    [(WALL, 0.002), (WALL, 0.003), (WALL, 0.004), (SIDE_SLOPE, TIMESTEP), (DITCH, 0.003)],
    ids=lambda one: getattr(one, "kind", one),
)
def test_an_obstacle_near_the_limits_is_passed(obstacle, timestep):
    assert drive(obstacle, BY_MAP, tries=3, most_time=5.0, timestep=timestep).passed
