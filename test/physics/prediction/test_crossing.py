# SPDX-License-Identifier: Apache-2.0
"""Between waypoints: faces are climbed through steep contacts, and what fails there is told."""

from functools import lru_cache

import numpy as np
import pytest

from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import Verdict, hold_against_limits
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rough_grounds import plane, smooth
from support.rover_geometry import balance_residuals

LSR1 = load_rover("lsr1")
FREE = unlimited(LSR1)
RADIUS = LSR1.wheel.radius
SWAP = [3, 4, 5, 0, 1, 2]


def sharp(kind: str, size: float, resolution: float = 0.005) -> Terrain:
    """Return the step, or the bump under y > 0, of `size` [m] with a face one fine cell long."""
    axis = -2.2 + resolution * np.arange(round(4.4 / resolution) + 1)
    x, y = np.meshgrid(axis, axis)
    if kind == "step":
        height = size * np.clip(x / resolution + 0.5, 0.0, 1.0)
    else:
        height = np.where(y > 0.0, size * np.clip((0.15 - abs(x)) / resolution + 0.5, 0, 1), 0.0)
    return Terrain(height, resolution, (-2.2, -2.2))


def drive(ground: Terrain, spacing: float = 0.01, **options) -> tuple[PathPrediction, Verdict]:
    prediction = judge_path(FREE, ground, drive_path(spacing), SweepOptions(**options))[0]
    return prediction, hold_against_limits(FREE, prediction)


@lru_cache(maxsize=8)
def over_step(height: float, policy: str = "optimal", friction: float = 0.8):
    return drive(drive_ground("step", height), policy=policy, friction=friction)


# Where there is nothing to cross


@pytest.mark.parametrize(
    "ground", [plane(0.0, 0.0, half=2.0), plane(0.3, 0.2, half=2.0), smooth(4, 2.0)],
    ids=["level", "slope", "waves"],
)  # fmt: skip
def test_on_smooth_ground_there_is_nothing_between_waypoints(ground):
    prediction, _ = drive(ground)
    assert prediction.settled.all()
    assert len(prediction.between.poses) == 0
    assert not prediction.falling.any() and not prediction.wheel_drop.any()


# Faces


@pytest.mark.parametrize("height", [0.15, 0.25])
def test_a_wall_higher_than_the_wheel_is_climbed_through_contacts_near_90_degrees(height):
    prediction, _ = drive(sharp("step", height))
    angles = np.degrees(prediction.between.contact_angle)
    assert (angles.max(axis=0) > 85.0).all(), "each wheel climbs the face"
    assert angles.max() <= 90.0


def test_the_steepest_contact_is_the_slope_of_the_face():
    for height in (0.15, 0.25):
        face = np.degrees(np.arctan(height / 0.04))
        prediction, _ = over_step(height)
        assert np.degrees(prediction.between.contact_angle).max() == pytest.approx(face, abs=0.5)


def test_what_happens_on_a_face_belongs_to_the_waypoint_that_follows():
    prediction, _ = over_step(0.2)
    between = prediction.between
    before = prediction.poses[between.waypoint - 1, 0]
    after = prediction.poses[between.waypoint, 0]
    assert len(between.poses) and (np.diff(between.waypoint) >= 0).all()
    assert (before <= between.poses[:, 0]).all() and (between.poses[:, 0] <= after).all()


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_the_forces_on_a_face_balance_too(policy):
    prediction, _ = over_step(0.2, policy)
    between = prediction.between
    residuals = [balance_residuals(LSR1, between, i) for i in np.flatnonzero(between.settled)]
    assert len(residuals) > 10
    assert np.abs(residuals).max() <= 1e-9


def test_a_failure_on_a_face_is_told_at_the_waypoint_that_follows():
    prediction, verdict = drive(drive_ground("step", 0.2), policy="optimal", max_torque=0.5)
    assert not verdict.traversable and verdict.code == "torque"
    assert verdict.reason.startswith("on the way here: ")
    assert "motor saturates" in verdict.reason
    assert verdict.first_failure == prediction.between.waypoint[0]
    place = prediction.poses[verdict.first_failure, 0] + LSR1.suspension.wheels["front"][0]
    assert place == pytest.approx(-RADIUS, abs=0.02), "the front wheels are at the face"


def test_the_margins_of_a_verdict_count_what_is_between_waypoints():
    prediction, verdict = over_step(0.2)
    worst = np.nanmax(prediction.between.friction_utilisation[0])
    at_waypoints = np.nanmax(prediction.friction_utilisation)
    assert verdict.max_friction_utilisation >= max(worst, at_waypoints) > 0.0


# The higher the harder


@pytest.mark.parametrize("height", [0.06, 0.12, 0.2])
def test_friction_decides_between_passing_and_slipping(height):
    outcomes = [over_step(height, "optimal", mu)[1] for mu in (0.2, 0.4, 0.6, 0.8, 1.2)]
    assert outcomes[-1].traversable and not outcomes[0].traversable
    passable = [outcome.traversable for outcome in outcomes]
    assert passable == sorted(passable), "more friction never makes it worse"
    assert outcomes[0].code == "friction"


@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_torque_decides_between_passing_and_stalling(policy):
    codes = []
    for torque in (0.2, 0.5, 0.8, 1.6, 3.2):
        ground = drive_ground("step", 0.12)
        codes.append(drive(ground, policy=policy, friction=2.0, max_torque=torque)[1].code)
    passable = [code == "" for code in codes]
    assert passable == sorted(passable)
    assert codes[0] == "torque" and codes[-1] == ""


# One side, and ditches


@pytest.mark.parametrize("height", [0.05])
def test_an_obstacle_under_one_side_does_to_that_side_what_its_mirror_image_does(height):
    left = sharp("bump", height, 0.02)
    right = Terrain(left.elevation[::-1], left.resolution, left.origin)
    (one, _), (other, _) = drive(left), drive(right)
    assert one.settled.all() and other.settled.all()
    assert one.wheel_loads == pytest.approx(other.wheel_loads[:, SWAP], abs=0.01)
    assert one.roll == pytest.approx(-other.roll, abs=1e-4)
    assert one.roll.max() > 0.25 * height / 0.62, "the left side goes up"
    assert not np.degrees(one.between.contact_angle[:, :3]).any(), "the right side stays level"


# Spacing


@pytest.mark.parametrize("policy", ["equal", "optimal"])
@pytest.mark.parametrize(
    ("kind", "size"),
    [("step", 0.15), ("ditch", 0.1), ("ditch", 0.26), ("bump_one_side", 0.07)],
)  # fmt: skip
def test_waypoints_each_centimetre_and_each_other_centimetre_have_the_same_verdict(
    kind, size, policy
):
    ground = drive_ground(kind, size)
    for friction in (0.4, 0.9):
        fine, coarse = (
            drive(ground, spacing, policy=policy, friction=friction)[1] for spacing in (0.01, 0.02)
        )
        assert fine.traversable == coarse.traversable
        assert fine.code == coarse.code


# The foot of a step


def test_a_wheel_that_meets_an_edge_is_judged_as_it_leaves_the_ground_wherever_waypoints_are():
    height = 0.8 * RADIUS
    needed = []
    for shift in (0.0, 0.0034, 0.0068, 0.0071, 0.0142):
        poses = drive_path(0.02) + np.array([shift, 0.0, 0.0])
        prediction = judge_path(
            FREE, sharp("step", height), poses, SweepOptions(policy="optimal", friction=0.5)
        )[0]
        between = prediction.between
        front = (between.poses[:, 0] < -0.3) & (between.contact_angle[:, 2] > 0.0)
        needed.append(between.friction_utilisation[front].max())
        leaving = np.arccos(1.0 - height / RADIUS)
        assert between.contact_angle[front].max() == pytest.approx(leaving, abs=0.01)
    assert max(needed) < 1.01 * min(needed)


@pytest.mark.parametrize("height", [0.06, 0.15])
def test_at_the_foot_of_a_step_every_pose_settles(height):
    """Each 0.1 mm from 3 cm before the wheel touches the face to 3 cm after."""
    reach = np.sqrt(RADIUS**2 - max(RADIUS - height, 0.0) ** 2)
    place = -LSR1.suspension.wheels["front"][0] - reach
    x = place + np.arange(-0.03, 0.03, 0.0001)
    prediction = judge_path(FREE, sharp("step", height), np.column_stack([x, 0 * x, 0 * x]))[0]
    assert prediction.settled.all()


@pytest.mark.parametrize("height", [0.12, 0.2])
def test_at_the_foot_of_a_wall_a_wheel_touches_tread_and_face_at_once(height):
    """Its centre is a radius above the tread and a radius before the face, and no higher yet."""
    ground = sharp("step", height)
    place = -LSR1.suspension.wheels["front"][0] - RADIUS
    x = place + np.arange(-0.01, 0.02, 0.0005)
    prediction = judge_path(FREE, ground, np.column_stack([x, 0 * x, 0 * x]))[0]
    centre = prediction.wheel_centres[:, 2]
    before = centre[:, 2] < RADIUS + 1e-3
    assert prediction.settled.all()
    assert before.any() and not before.all()
    foot = centre[before][-1]
    assert foot[2] == pytest.approx(RADIUS, abs=1e-3)
    assert foot[0] == pytest.approx(-RADIUS, abs=0.5 * ground.resolution + 1e-3)
    assert prediction.between is not None
    assert np.degrees(prediction.between.contact_angle).max() > 85.0
