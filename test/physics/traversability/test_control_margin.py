# SPDX-License-Identifier: Apache-2.0
"""The control margin: what a waypoint that needs traction control leaves to the controller."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.errors import ModelError
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.classification import (
    IMPASSABLE,
    PASSABLE,
    WITH_SPEED_SERVOS,
    WITH_TRACTION_CONTROL,
    classify_path,
)
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.torque_ranges import find_torque_ranges
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rough_grounds import plane, random_poses, rocky

LSR1 = load_rover("lsr1")
POSE = [[0.0, 0.0, 0.0]]
OPTIMAL = SweepOptions(policy="optimal")
STEEP = plane(0.45, 0.0)
"""A slope on which equal torques slip and optimal ones use 0.58 of the friction of 0.8."""


@pytest.mark.parametrize(("margin", "passes"), [(0.0, True), (0.2, True), (0.3, False)])
def test_a_waypoint_that_needs_traction_control_keeps_the_margin(margin, passes):
    rover, bump = unlimited(LSR1), drive_ground("bump_one_side", 0.1)
    options = replace(OPTIMAL, friction=1.0, max_torque=1.0, control_margin=margin)
    verdict = judge_path(rover, bump, drive_path()[54:59], options)[1]
    found = classify_path(rover, bump, drive_path()[54:59], options)[2]
    assert verdict.traversable is passes
    assert found.traversability_class == (WITH_TRACTION_CONTROL if passes else IMPASSABLE)
    assert ("1 less control margin 0.3" in verdict.reason) is not passes
    assert found.reason == verdict.reason or passes


@pytest.mark.parametrize(("margin", "passes"), [(0.3, True), (0.5, False)])
def test_what_speed_servos_pass_is_classed_so_whatever_the_margin(margin, passes):
    options = replace(OPTIMAL, control_margin=margin)
    assert judge_path(LSR1, STEEP, POSE, options)[1].traversable is passes
    found = classify_path(LSR1, STEEP, POSE, options)[0]
    assert found.traversability_class == WITH_SPEED_SERVOS


def test_torques_keep_the_margin_where_they_can():
    step = drive_ground("step", 0.08)
    options = replace(OPTIMAL, friction=1.0, max_torque=0.85)
    free = judge_path(LSR1, step, drive_path(), options)[0]
    kept = judge_path(LSR1, step, drive_path(), replace(options, control_margin=0.2))[0]
    assert free.between is not None and kept.between is not None
    assert free.between.torque_saturation.max() > 0.8
    assert kept.between.torque_saturation.max() <= 0.8 + 1e-9
    assert kept.control_margin == 0.2


def test_what_equal_torques_pass_needs_no_margin():
    poses = random_poses(3, 300, 2.0)
    ground, options = rocky(3), SweepOptions(friction=0.5, policy="optimal", control_margin=0.6)
    equal = judge_path(LSR1, ground, poses, replace(options, policy="equal"))[1]
    optimal = judge_path(LSR1, ground, poses, options)[1]
    physical = judge_path(LSR1, ground, poses, replace(options, control_margin=0.0))[1]
    passes = [
        {i for i, code in enumerate(v.codes) if not code} for v in (equal, optimal, physical)
    ]
    assert passes[0] <= passes[1] < passes[2]
    classes = classify_path(LSR1, ground, poses, options)
    named = {i for i, c in enumerate(classes) if c.traversability_class == PASSABLE}
    assert named == passes[0]


def test_the_margin_holds_within_the_bounds_of_an_uncertain_map():
    std = np.full(STEEP.elevation.shape, 2e-4)
    ground = replace(STEEP, elevation_std=std)
    options = replace(OPTIMAL, control_margin=0.0)
    _, physical = judge_path(LSR1, ground, POSE, options)
    bound = physical.friction_utilisation_bound
    assert physical.traversable and bound > physical.max_friction_utilisation
    between = 1.0 - 0.5 * (bound + physical.max_friction_utilisation)
    assert judge_path(LSR1, STEEP, POSE, replace(options, control_margin=between))[1].traversable
    refused = judge_path(LSR1, ground, POSE, replace(options, control_margin=between))[1]
    assert "control margin" in refused.reason and "at worst" in refused.reason


def test_the_ranges_of_the_torques_are_physical():
    wide = find_torque_ranges(LSR1, STEEP, POSE)
    asked = find_torque_ranges(LSR1, STEEP, POSE, SweepOptions(control_margin=0.4))
    np.testing.assert_array_equal(asked.highest, wide.highest)


@pytest.mark.parametrize("margin", [-0.1, 1.0, float("nan")])
def test_a_margin_outside_its_range_is_named(margin):
    with pytest.raises(ModelError, match="control_margin"):
        SweepOptions(control_margin=margin)


@pytest.mark.parametrize("height", [0.12, 0.16, 0.20])
def test_a_bump_that_takes_all_the_torque_of_one_side_is_not_promised(height):
    rover, ground = unlimited(LSR1), drive_ground("bump_one_side", height)
    options = SweepOptions(friction=0.8, max_torque=0.81, policy="optimal")
    assert judge_path(rover, ground, drive_path(), options)[1].traversable
    promised = judge_path(rover, ground, drive_path(), replace(options, control_margin=0.1))[1]
    assert not promised.traversable and "control margin" in promised.reason
