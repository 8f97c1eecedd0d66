# SPDX-License-Identifier: Apache-2.0
"""Between waypoints: faces are climbed, wheels drop off edges, and wedge in slots."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_path, judge_paths
from rover_physics.prediction import crossing
from rover_physics.prediction.drops import FACE
from support.grounds import make_terrain, plane, rocky, smooth
from support.paths import poses_at
from support.predictions import assert_same
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rover_geometry import balance_residuals
from support.rovers import LSR1

FREE = unlimited(LSR1)
RADIUS = LSR1.wheel.radius


def sharp_step(size: float, resolution: float = 0.005) -> Terrain:
    """Return the step of `size` [m] with a face one fine cell long."""
    return make_terrain(lambda x, y: size * np.clip(x / resolution + 0.5, 0, 1), resolution, 2.2)


def drive(ground, rover=FREE, **options):
    """Return prediction and verdict of a drive without a look at traps."""
    asked = rover, ground, [drive_path()], SweepOptions(**options)
    return judge_paths(*asked, check_entrapment=False)[0]


def falling_away(degrees: float) -> Terrain:
    """Return level ground that goes over into a slope down along +x, at x = 0."""
    return make_terrain(lambda x, y: -np.tan(np.radians(degrees)) * np.maximum(x, 0.0), 0.04, 2.2)


@pytest.mark.parametrize(
    ("ground", "is_smooth"),
    [
        (plane(0.0, 0.0, half=2.0), True), (plane(0.3, 0.2, half=2.0), True),
        (smooth(4, 2.0), True), (falling_away(10.0), False), (falling_away(35.0), False),
        (drive_ground("step", 0.15), False),
    ],
    ids=["level", "slope", "waves", "crest", "steep crest", "step up"],
)  # fmt: skip
def test_without_an_edge_no_wheel_falls_and_smooth_ground_has_nothing_between_waypoints(
    ground, is_smooth
):
    prediction, _ = drive(ground)
    assert prediction.settled.all()
    assert not prediction.falling.any() and not prediction.wheel_drop.any()
    assert not is_smooth or len(prediction.between.poses) == 0


def test_groups_and_little_space_change_nothing_of_what_is_found(monkeypatch):
    asked = FREE, rocky(5), poses_at(np.linspace(-1.0, 1.0, 101))
    whole = judge_path(*asked)[0].between
    monkeypatch.setattr(crossing, "GROUP", 3)
    monkeypatch.setattr(crossing, "POSES_IN_STRETCH", 1)
    assert len(whole.poses) > 10
    assert_same(judge_path(*asked)[0].between, whole)


def test_a_wall_higher_than_the_wheel_is_climbed_through_contacts_near_90_degrees():
    prediction, _ = drive(sharp_step(0.25))
    angles = np.degrees(prediction.between.contact_angle)
    assert (angles.max(axis=0) > 85.0).all(), "each wheel climbs the face"
    assert angles.max() <= 90.0


def test_both_sides_climb_together_where_the_ground_is_alike():
    """Between foot and top both are places to stand, also one side up and the other down."""
    prediction, _ = drive(drive_ground("ditch", 0.5214))
    heights = prediction.between.wheel_centres[:, :, 2]
    np.testing.assert_allclose(heights[:, :3], heights[:, 3:], atol=1e-3)


def test_what_happens_on_a_face_balances_and_counts_at_the_waypoint_that_follows():
    prediction, verdict = drive(drive_ground("step", 0.2), policy="optimal", friction=0.8)
    between = prediction.between
    before = prediction.poses[between.waypoint - 1, 0]
    after = prediction.poses[between.waypoint, 0]
    assert len(between.poses) and (np.diff(between.waypoint) >= 0).all()
    assert (before <= between.poses[:, 0]).all() and (between.poses[:, 0] <= after).all()
    residuals = [balance_residuals(LSR1, between, i) for i in np.flatnonzero(between.settled)]
    assert len(residuals) > 10 and np.abs(residuals).max() <= 1e-9
    worst, at_waypoints = (np.nanmax(p.friction_utilisation) for p in (between, prediction))
    assert verdict.max_friction_utilisation == max(worst, at_waypoints) > 0.0


def test_a_failure_on_a_face_is_told_at_the_waypoint_that_follows():
    prediction, verdict = drive(drive_ground("step", 0.2), policy="optimal", max_torque=0.5)
    assert not verdict.traversable and verdict.code == "torque"
    assert verdict.reason.startswith("on the way here: ")
    assert "motor saturates" in verdict.reason
    assert verdict.first_failure == prediction.between.waypoint[0]
    place = prediction.poses[verdict.first_failure, 0] + LSR1.suspension.wheels["front"][0]
    assert place == pytest.approx(-RADIUS, abs=0.02), "the front wheels are at the face"


def test_a_wheel_that_meets_an_edge_is_judged_as_it_leaves_the_ground_wherever_waypoints_are():
    height = 0.8 * RADIUS
    needed = []
    for shift in (0.0, 0.0034, 0.0068, 0.0071, 0.0142):
        poses, options = drive_path(0.02) + poses_at(shift), SweepOptions("optimal", friction=0.5)
        between = judge_path(FREE, sharp_step(height), poses, options)[0].between
        front = (between.poses[:, 0] < -0.3) & (between.contact_angle[:, 2] > 0.0)
        needed.append(between.friction_utilisation[front].max())
        leaving = np.arccos(1.0 - height / RADIUS)
        assert between.contact_angle[front].max() == pytest.approx(leaving, abs=0.01)
    assert max(needed) < 1.01 * min(needed)


@pytest.mark.parametrize("height", [0.15, 0.2])
def test_at_the_foot_of_a_wall_a_wheel_touches_tread_and_face_at_once(height):
    """Its centre is a radius above the tread and a radius before the face, and no higher yet."""
    ground = sharp_step(height)
    place = -LSR1.suspension.wheels["front"][0] - RADIUS
    x = place + np.arange(-0.03, 0.03, 0.0001)
    prediction = judge_path(FREE, ground, poses_at(x))[0]
    centre = prediction.wheel_centres[:, 2]
    before = centre[:, 2] < RADIUS + 1e-3
    assert prediction.settled.all()
    assert before.any() and not before.all()
    foot = centre[before][-1]
    assert foot[2] == pytest.approx(RADIUS, abs=1e-3)
    assert foot[0] == pytest.approx(-RADIUS, abs=0.5 * ground.resolution + 1e-3)


EDGE = drive_ground("step", -0.15)
"""A step of 15 cm that goes down along +x."""
SLIPPERY = 0.27
"""Friction that holds a wheel up to 15 degrees: it falls from the edge almost at once."""


@pytest.mark.parametrize("height", [0.05, 0.2])
def test_a_wheel_rolls_over_an_edge_and_drops_by_the_rest_of_its_height(height):
    """It rolls until the forces do not balance, at most until the edge is a face below it."""
    rolled = RADIUS * (1.0 - np.cos(FACE))
    prediction, _ = drive(drive_ground("step", -height), friction=SLIPPERY)
    drops = prediction.wheel_drop.max(axis=0)
    assert (drops <= height + 1e-3).all() and (drops >= height - rolled - 1e-3).all()


@pytest.mark.parametrize(
    ("policy", "friction"), [("equal", 0.2), ("equal", 1.5), ("servo", 1.5), ("optimal", 1.5)]
)
def test_no_friction_hides_a_fall_from_a_wall_that_is_too_high(policy, friction):
    """Too high is the limit and what a wheel rolls over the edge before it falls."""
    rolled = RADIUS * (1.0 - np.cos(FACE))
    down = drive_ground("step", -(LSR1.limits.wheel_drop + rolled + 5e-3))
    assert "wheel_drop" in drive(down, LSR1, friction=friction, policy=policy)[1].codes


@pytest.mark.parametrize("start", [0.0, 0.004, 0.009, 0.015])
@pytest.mark.parametrize(("spacing", "east"), [(0.02, 0.0), (RADIUS, 3.0), (RADIUS, 100.3)])
def test_a_drop_does_not_depend_on_where_waypoints_are_and_how_they_are_rounded(
    spacing, east, start
):
    ground = replace(EDGE, origin=(EDGE.origin[0] + east, EDGE.origin[1]))
    path = drive_path(spacing) + poses_at(east + start)
    prediction = judge_path(FREE, ground, path, SweepOptions(friction=0.8))[0]
    np.testing.assert_allclose(prediction.wheel_drop.max(axis=0), 0.1207, atol=1e-3)


@pytest.mark.parametrize(("policy", "friction"), [("equal", 0.3), ("optimal", 0.2)])
def test_a_wheel_rolls_down_a_smooth_bump_however_slippery_if_the_others_hold_it(policy, friction):
    def bump(x, y):
        return 0.14 * np.cos(np.pi * x / 0.8) ** 2 * ((np.abs(x) < 0.4) & (y > 0.0))

    _, verdict = drive(make_terrain(bump, 0.04, 3.0), LSR1, friction=friction, policy=policy)
    assert verdict.traversable and verdict.max_wheel_drop == 0.0


def test_a_drop_is_told_where_the_wheel_lands():
    prediction, _ = drive(EDGE)
    for name, wheel in (("rear", 0), ("middle", 1), ("front", 2)):
        where = prediction.poses[prediction.wheel_drop[:, wheel].argmax(), 0]
        assert 0.0 < where + LSR1.suspension.wheels[name][0] <= 2.0 * RADIUS


def test_while_a_wheel_falls_neither_friction_nor_torque_are_asked_for():
    prediction, verdict = drive(drive_ground("step", -0.2), friction=0.4)
    needed = prediction.friction_utilisation[prediction.falling.any(axis=1)]
    assert len(needed) and needed.max() > 1.0
    assert verdict.traversable and verdict.max_friction_utilisation < 1.0


def test_a_slope_too_slippery_to_stand_on_is_refused_for_friction_and_not_a_fall():
    prediction, verdict = drive(plane(-0.5, 0.0, half=2.0), friction=0.3)
    assert verdict.code == "friction" and not prediction.wheel_drop.any()


@pytest.mark.parametrize("policy", ["optimal", "servo"])
def test_a_wheel_that_falls_into_a_slot_as_wide_as_itself_is_wedged(policy):
    wide, narrow = (
        drive(drive_ground("ditch", width), policy=policy, friction=0.86, max_torque=2.44)[1]
        for width in (0.194, 0.10)
    )
    assert wide.code == "friction" and "wedged" in wide.reason
    assert narrow.traversable


def test_a_wedged_rover_is_refused_with_any_friction_in_all_samples():
    options = SweepOptions("optimal", friction=0.86, max_torque=2.44)
    asked = FREE, drive_ground("ditch", 0.194), [drive_path()], options
    assert judge_paths(*asked, accepted_chance=1.0)[0][1].failure_chance == 1.0
