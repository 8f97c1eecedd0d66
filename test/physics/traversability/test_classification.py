# SPDX-License-Identifier: Apache-2.0
"""Classes: what a waypoint needs to be passed, why, and with which margin of control."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, classify_path, judge_path, judge_poses
from rover_physics.errors import ModelError
from rover_physics.names import WHEELS
from rover_physics.traversability.classification import (
    IMPASSABLE,
    PASSABLE,
    WHEEL_CONSTRAINTS,
    WITH_SPEED_SERVOS,
    WITH_TRACTION_CONTROL,
    classify_judged,
    deciding_waypoint,
)
from rover_physics.traversability.verdict import hold_against_limits
from support.grounds import bowl, fractal, make_terrain, plane, random_poses, rocky, with_std
from support.paths import poses_at
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rovers import LSR1

POSE = [[0.0, 0.0, 0.0]]
STEEP = plane(0.45, 0.0)
"""A slope on which equal torques slip and optimal ones use 0.58 of the friction of 0.8."""
ONTO_A_BUMP = unlimited(LSR1), drive_ground("bump_one_side", 0.1), drive_path()[54:59]
"""Rover, ground, and waypoints; the third one follows the climb of the right front wheel."""
WEAK = SweepOptions(friction=1.0, max_torque=1.0)
"""Motors with which speed servos stall at the bump, and optimal torques do not."""


def test_a_passable_waypoint_names_its_tightest_constraint():
    found = classify_path(LSR1, plane(0.2, 0.0), POSE)[0]
    equal = judge_path(LSR1, plane(0.2, 0.0), POSE)[0]
    used = equal.friction_utilisation[0]
    assert found.constraint == "friction"
    assert found.wheel == WHEELS[int(np.argmax(used))]
    assert found.margin == pytest.approx(1.0 - used.max())
    assert found.policy == "equal"


def test_with_speed_servos_the_margin_is_that_of_the_whole_rover():
    found = classify_path(LSR1, STEEP, POSE)[0]
    servo = judge_path(LSR1, STEEP, POSE, SweepOptions(policy="servo"))[0]
    shear = np.hypot(servo.tangential[0], servo.lateral[0]).sum()
    assert (found.policy, found.constraint) == ("servo", "friction")
    assert found.margin == pytest.approx(1.0 - shear / (0.8 * servo.wheel_loads[0].sum()))
    assert found.margin > 0.0
    assert "slips" in found.reason


def test_a_climb_that_stalls_servos_needs_traction_control_and_its_margin_is_that_of_optimal():
    found = classify_path(*ONTO_A_BUMP, WEAK)
    assert [waypoint.traversability_class for waypoint in found] == [
        PASSABLE, PASSABLE, WITH_TRACTION_CONTROL, PASSABLE, PASSABLE,
    ]  # fmt: skip
    optimal = judge_path(*ONTO_A_BUMP, replace(WEAK, policy="optimal"))[0].between
    assert found[2].policy == "optimal"
    assert found[2].margin == pytest.approx(1.0 - optimal.torque_saturation.max())
    assert "motors stall" in found[2].reason


def test_limits_that_are_no_wheels_name_no_wheel():
    careful = replace(LSR1, limits=replace(LSR1.limits, tilt=0.1))
    found = classify_path(careful, plane(0.2, 0.0), POSE)[0]
    assert (found.traversability_class, found.constraint, found.wheel) == (IMPASSABLE, "tilt", "")
    assert found.margin == pytest.approx(1.0 - np.arctan(0.2) / 0.1, abs=1e-3)
    found = classify_path(LSR1, plane(0.0, 0.0), [[50.0, 0.0, 0.0]])[0]
    assert (found.traversability_class, found.constraint) == (IMPASSABLE, "off_map")
    assert np.isnan(found.margin)


def test_classes_agree_with_the_verdicts_of_all_policies():
    ground, poses = rocky(3), random_poses(3, 60, 1.8)
    classes = classify_path(LSR1, ground, poses, SweepOptions(friction=0.22))
    paths = [
        judge_path(LSR1, ground, poses, SweepOptions(friction=0.22, policy=policy))[0]
        for policy in ("equal", "servo", "optimal")
    ]
    falls = np.any([path.falling.any(axis=1) for path in paths], axis=0)
    named = PASSABLE, WITH_SPEED_SERVOS, WITH_TRACTION_CONTROL
    policies = zip(*(hold_against_limits(LSR1, path).codes for path in paths), strict=True)
    for waypoint, codes, fall in zip(classes, policies, falls, strict=True):
        passed = [name for name, code in zip(named, codes, strict=True) if not code]
        assert waypoint.traversability_class == (passed[0] if passed else IMPASSABLE)
        if not passed:
            assert waypoint.constraint == codes[-1]
            assert not waypoint.margin > 0.0
        elif not fall:
            assert waypoint.constraint in WHEEL_CONSTRAINTS
            assert waypoint.margin >= -1e-9
    assert len({waypoint.traversability_class for waypoint in classes}) >= 3


def test_where_the_rover_would_be_trapped_the_waypoint_is_impassable_for_that():
    ground, poses = bowl(0.7, 1.2, np.radians(18.0)), poses_at(np.arange(-5.0, 0.0, 0.04))
    verdict = judge_path(LSR1, ground, poses, SweepOptions(policy="optimal", soil="dry_sand"))[1]
    classes = classify_path(LSR1, ground, poses, SweepOptions(soil="dry_sand"))
    assert verdict.code == "trapped"
    deciding = deciding_waypoint(classes)
    assert deciding == verdict.first_failure
    assert classes[deciding].traversability_class == IMPASSABLE
    assert (classes[deciding].constraint, classes[deciding].wheel) == ("trapped", "")
    assert classes[deciding].reason == verdict.reason
    assert np.isnan(classes[deciding].margin)


@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_classes_do_not_depend_on_the_policy_that_was_judged_first(policy):
    judged = judge_path(LSR1, STEEP, POSE, SweepOptions(policy=policy))
    found = classify_judged(LSR1, STEEP, *judged, SweepOptions())
    assert found == classify_path(LSR1, STEEP, POSE)


def test_on_uncertain_ground_speed_servos_are_not_asked_about():
    uncertain = with_std(STEEP, 1e-4)
    found = classify_path(LSR1, uncertain, POSE)
    assert found[0].traversability_class == WITH_TRACTION_CONTROL
    with pytest.raises(ModelError, match="policy 'servo' has no bounds"):
        judge_path(LSR1, uncertain, POSE, SweepOptions(policy="servo"))


def test_a_path_hangs_on_its_worst_waypoint():
    poses = [[x, 0.0, 0.0] for x in (-0.3, -0.1, 0.1, 0.3)]
    rising = make_terrain(lambda x, y: 0.08 * (x + 1.2) ** 2, 0.04, 1.2)
    classes = classify_path(LSR1, rising, poses)
    assert {waypoint.traversability_class for waypoint in classes} == {PASSABLE}
    margins = [waypoint.margin for waypoint in classes]
    assert deciding_waypoint(classes) == int(np.argmin(margins)) == 3
    refused = classify_path(LSR1, rising, [*poses, [50.0, 0.0, 0.0], [60.0, 0.0, 0.0]])
    assert deciding_waypoint(refused) == 4


OPTIMAL = SweepOptions(policy="optimal")


@pytest.mark.parametrize(("margin", "passes"), [(0.0, True), (0.2, True), (0.3, False)])
def test_a_waypoint_that_needs_traction_control_keeps_the_margin(margin, passes):
    options = replace(WEAK, policy="optimal", control_margin=margin)
    verdict = judge_path(*ONTO_A_BUMP, options)[1]
    found = classify_path(*ONTO_A_BUMP, options)[2]
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


@pytest.mark.parametrize(
    ("ground", "margin"),
    [(rocky(3), 0.6), (with_std(fractal(1), 0.003), 0.0), (with_std(fractal(1), 0.003), 0.2)],
    ids=["certain", "uncertain", "uncertain, margin"],
)
def test_what_equal_torques_pass_at_worst_optimal_ones_do_too_whatever_the_margin(ground, margin):
    poses = random_poses(1, 40, 0.6)
    equal, optimal = (
        judge_poses(LSR1, ground, poses, options=options)[1]
        for options in (SweepOptions(friction=0.5), SweepOptions("optimal", margin, friction=0.5))
    )
    passed = [i for i, code in enumerate(equal.codes) if not code]
    assert passed
    assert [optimal.codes[i] for i in passed] == [""] * len(passed)


def test_the_margin_holds_within_the_bounds_of_an_uncertain_map():
    ground = with_std(STEEP, 2e-4)
    _, physical = judge_path(LSR1, ground, POSE, OPTIMAL)
    bound = physical.friction_utilisation_bound
    assert physical.traversable and bound > physical.max_friction_utilisation
    between = 1.0 - 0.5 * (bound + physical.max_friction_utilisation)
    options = replace(OPTIMAL, control_margin=between)
    assert judge_path(LSR1, STEEP, POSE, options)[1].traversable
    refused = judge_path(LSR1, ground, POSE, options)[1]
    assert "control margin" in refused.reason and "at worst" in refused.reason
