# SPDX-License-Identifier: Apache-2.0
"""Settling: all six wheels touch, where MuJoCo says, with straight and with turned wheels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from support.reference_cases import (
    angle_errors,
    reference_predictions,
    steered_predictions,
)
from support.rough_grounds import fractal, plane, random_poses, scaled_for
from support.rover_geometry import attitude_of, place_rover, wheel_axes, wheel_gaps

LSR1 = load_rover("lsr1")
GAP = 3e-5
"""What a settled pose may leave open [m]."""
ANGLE = 4.0 * GAP / 0.4
"""What that may turn [rad]."""
slopes = st.floats(-0.4, 0.4)
headings = st.floats(-np.pi, np.pi)
few = settings(max_examples=10)
both_sets = pytest.mark.parametrize(
    ("predict", "count"),
    [(reference_predictions, 81), (steered_predictions, 21)],
    ids=["straight", "turned"],
)


def waypoints_of(predictions):
    for case, prediction in predictions:
        for i in range(len(prediction.poses)):
            yield case, prediction, i


# Against the reference


def test_the_wheels_are_turned_as_the_arc_asks():
    for case, prediction in steered_predictions():
        np.testing.assert_allclose(prediction.steering_angle, case.steering, atol=1e-12)


@both_sets
def test_all_cases_settle_with_wheels_attitude_and_suspension_where_mujoco_has_them(
    predict, count
):
    errors = []
    for case, prediction in predict():
        assert prediction.settled.all(), case.label
        away = prediction.wheel_centres - case.wheel_centres
        errors.append(np.linalg.norm(away, axis=2).ravel())
    errors = np.concatenate(errors)
    assert errors.size == count * 6
    assert np.median(errors) <= 0.5e-3 and np.percentile(errors, 95) <= 2.5e-3
    angles = angle_errors(predict())
    assert np.median(angles) <= 0.5e-3 and np.percentile(angles, 95) <= 5e-3


@both_sets
def test_wheels_touch_by_an_independent_dense_look_over_their_whole_width(predict, count):
    cases = list(waypoints_of(predict()))[::4]  # a look takes long
    gaps = np.concatenate([wheel_gaps(LSR1, case.terrain, p, i) for case, p, i in cases])
    assert gaps.size >= count * 6 // 4
    assert (np.abs(gaps) <= 1e-4).mean() >= (0.99 if predict is reference_predictions else 0.98)
    assert gaps.max() <= 3e-4 and gaps.min() >= -1e-3


@both_sets
def test_contact_points_lie_on_the_wheels_and_on_the_ground(predict, count):
    for case, prediction, i in waypoints_of(predict()):
        points, axes = prediction.contact_points[i], wheel_axes(LSR1, prediction, i)
        from_centre = points - prediction.wheel_centres[i]
        along = np.einsum("wk,wk->w", from_centre, axes)
        radial = np.linalg.norm(from_centre - along[:, None] * axes, axis=1)
        assert radial == pytest.approx(LSR1.wheel.radius, abs=1e-12)
        assert (np.abs(along) <= 0.5 * LSR1.wheel.width + 1e-12).all()
        heights = case.terrain.elevation_at(points[:, 0], points[:, 1])
        assert points[:, 2] == pytest.approx(heights, abs=0.01)


# Kinematics


@pytest.mark.parametrize("preset", ["lsr1", "m2020"])
def test_wheel_centres_follow_from_pose_and_suspension_angles(preset):
    rover = load_rover(preset)
    ground, poses = scaled_for(rover, fractal(3), random_poses(1, 20, 0.8))
    prediction = judge_path(rover, ground, poses)[0]
    assert prediction.settled.all()
    assert np.array_equal(prediction.rocker_angle[:, 1], -prediction.rocker_angle[:, 0])
    for i in range(20):
        wheels = place_rover(rover, prediction, i).wheels
        assert prediction.wheel_centres[i] == pytest.approx(wheels, abs=1e-11 * rover.wheel.radius)


@few
@given(slopes, slopes, st.floats(-5.0, 5.0), headings)
def test_on_a_plane_the_rover_lies_like_the_plane(slope_x, slope_y, height, yaw):
    prediction = judge_path(LSR1, plane(slope_x, slope_y, height), [[0.1, -0.05, yaw]])[0]
    assert prediction.settled.all()
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    assert attitude_of(prediction, 0)[:, 2] == pytest.approx(normal, abs=ANGLE)
    assert prediction.rocker_angle[0] == pytest.approx([0.0, 0.0], abs=ANGLE)
    assert prediction.bogie_angle[0] == pytest.approx([0.0, 0.0], abs=ANGLE)
    foot = prediction.position[0] - normal * 0.30
    assert foot[2] == pytest.approx(slope_x * foot[0] + slope_y * foot[1] + height, abs=2.0 * GAP)


# It settles nearly everywhere, and says so where it doesn't


def known_to_the_left_of(x_edge: float) -> Terrain:
    ground = plane(0.0, 0.0)
    elevation = ground.elevation.copy()
    x = ground.origin[0] + np.arange(elevation.shape[1]) * ground.resolution
    elevation[:, x > x_edge] = np.nan
    return Terrain(elevation, ground.resolution, ground.origin)


LEVEL = plane(0.0, 0.0)
REACH = LEVEL.bounds[1] - 0.5
"""Where the front wheels touch the last cell of the map."""


@pytest.mark.parametrize(
    ("ground", "x", "status"),
    [
        (known_to_the_left_of(0.6), 0.0, PoseStatus.SETTLED),
        (known_to_the_left_of(0.6), 0.3, PoseStatus.UNKNOWN_GROUND),
        (known_to_the_left_of(1.0), 0.95, PoseStatus.OFF_MAP),  # comes before unknown ground
        (LEVEL, REACH - 0.001, PoseStatus.SETTLED),
        (LEVEL, REACH + 0.001, PoseStatus.OFF_MAP),
        (LEVEL, 40.0, PoseStatus.OFF_MAP),
    ],
)
def test_wheels_over_unknown_ground_and_off_the_map_are_told_apart(ground, x, status):
    prediction = judge_path(LSR1, ground, [[x, 0.0, 0.0]])[0]
    assert prediction.status.tolist() == [status]
    assert prediction.settled.tolist() == [status == PoseStatus.SETTLED]


def test_a_wall_across_the_rover_is_never_settled_by_a_guess():
    x = (np.arange(121) - 60) * 0.04
    wall = np.where(np.abs(x) < 0.10, 1.5, 0.0)
    ground = Terrain(np.broadcast_to(wall, (121, 121)).copy(), 0.04, (x[0], x[0]))
    poses = np.column_stack([np.linspace(-0.6, 0.6, 20), np.zeros((20, 2))])
    prediction = judge_path(LSR1, ground, poses)[0]
    for i in np.flatnonzero(prediction.settled):
        assert np.abs(wheel_gaps(LSR1, ground, prediction, i)).max() <= 5e-3
    assert (prediction.status == PoseStatus.NOT_SETTLED).any()


def test_a_rover_never_settles_turned_over():
    prediction = judge_path(LSR1, fractal(3, roughness=0.5), random_poses(3, 300, 1.9))[0]
    assert (prediction.status == PoseStatus.NOT_SETTLED).any()
    turned = np.maximum(np.abs(prediction.roll), np.abs(prediction.pitch))
    assert np.nanmax(turned) < 0.5 * np.pi


def test_poses_that_do_not_settle_have_nan_for_every_number():
    prediction = judge_path(LSR1, LEVEL, [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])[0]
    for name in (
        "position", "roll", "pitch", "rocker_angle", "bogie_angle", "wheel_centres",
        "contact_points", "contact_angle", "wheel_loads", "tangential", "lateral", "torque",
        "friction", "friction_utilisation", "slip_ratio", "torque_saturation", "tip_over_ratio",
        "tip_over_force_angle", "belly_clearance", "power", "energy", "time",
    ):  # fmt: skip
        values = getattr(prediction, name)
        assert np.isfinite(values[0]).all(), name
        assert np.isnan(values[1]).all(), name
