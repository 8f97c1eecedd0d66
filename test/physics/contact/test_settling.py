# SPDX-License-Identifier: Apache-2.0
"""Settling: all six wheels touch, where MuJoCo says and on rough ground; the belly is clear."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics import PathPrediction, PoseStatus, Terrain, judge_path, judge_poses
from rover_physics.results.record import QUANTITIES
from rover_physics.rover.urdf.read_rover import rover_from_urdf
from support.grounds import bouldered, fractal, plane, raised, random_poses, rocky, smooth
from support.paths import poses_at
from support.project.checkout import TOP
from support.reference_cases import STEERED, STRAIGHT, reference_predictions
from support.rover_geometry import ANGLE, GAP, attitude_of, place_rover, wheel_gap, wheel_gaps
from support.rovers import LSR1

slopes = st.floats(-0.4, 0.4)
both_sets = pytest.mark.parametrize(
    ("files", "count"), [(STRAIGHT, 81), (STEERED, 21)], ids=["straight", "turned"]
)


def waypoints_of(predictions):
    for case, prediction in predictions:
        for i in range(len(prediction.poses)):
            yield case, prediction, i


@both_sets
def test_all_cases_settle_with_wheels_attitude_and_suspension_where_mujoco_has_them(files, count):
    errors, angles = [], []
    for case, prediction in reference_predictions(files):
        assert prediction.settled.all(), case.label
        away = prediction.wheel_centres - case.wheel_centres
        errors.append(np.linalg.norm(away, axis=2).ravel())
        attitude = np.column_stack([prediction.roll, prediction.pitch])
        angles += [attitude - case.attitude, prediction.rocker_angle - case.joints[:, :2]]
        angles.append(prediction.bogie_angle - case.joints[:, 2:])
    errors, angles = np.concatenate(errors), np.abs(np.concatenate(angles))
    assert errors.size == count * 6
    assert np.median(errors) <= 0.5e-3 and np.percentile(errors, 95) <= 2.5e-3
    assert np.median(angles) <= 0.5e-3 and np.percentile(angles, 95) <= 5e-3


def test_turned_wheels_touch_by_an_independent_dense_look_over_their_whole_width():
    cases = list(waypoints_of(reference_predictions(STEERED)))[::4]  # a look takes long
    gaps = np.concatenate([wheel_gaps(LSR1, case.terrain, p, i) for case, p, i in cases])
    assert gaps.size == 36
    assert gaps.max() <= 3e-4 and gaps.min() >= -1e-3


def test_a_peak_below_a_wheel_is_found_wherever_it_is():
    """Also between the circles of the wheel that are looked at first."""
    level = Terrain(np.zeros((241, 241)), 0.01, (-1.2, -1.2))
    ground = raised(level, (120 - 31, 120), 0.03)  # below the middle right wheel
    x = LSR1.suspension.wheels["middle"][0]
    aside = 0.45 * LSR1.wheel.width * np.linspace(-1.0, 1.0, 19)
    prediction = judge_poses(LSR1, ground, poses_at(-x, aside), np.zeros(19))[0]
    assert prediction.settled.all()
    lift = prediction.wheel_centres[:, 1, 2] - LSR1.wheel.radius
    assert lift == pytest.approx(0.03, abs=2e-3)


def test_a_wheel_whose_rim_touches_the_edge_of_a_step_settles():
    """The rim slips off the edge while the rover is turned; the edge below the wheel holds it."""
    files = TOP / "examples" / "rover"
    rover = rover_from_urdf(files / "kit_rover.urdf", files / "kit_rover_joints.yaml").rover
    x = np.arange(-1.0, 1.0, 0.01)
    ground = Terrain(np.tile(np.where(x > 0.0, 0.06, 0.0), (101, 1)), 0.01, (-1.0, -0.5))
    poses = np.array([[x, 0.0, yaw] for x in (0.18, 0.19, 0.2) for yaw in (0.0, 0.04)])
    prediction = judge_poses(rover, ground, poses, np.zeros(len(poses)))[0]
    assert prediction.settled.all()
    gaps = np.array([wheel_gaps(rover, ground, prediction, i) for i in range(len(poses))])
    assert gaps.min() >= -1e-4


few_and_all = pytest.mark.parametrize("seeds", [1, pytest.param(10, marks=pytest.mark.long)])
EVERY = 50
"""Of so many poses one wheel of one pose is looked at by brute force."""


@lru_cache(maxsize=1)
def rough_predictions(seeds: int) -> list[tuple[Terrain, PathPrediction]]:
    """Return grounds with 1000 poses each, two of each seed."""
    grounds = [make(seed) for make in (fractal, bouldered) for seed in range(seeds)]
    return [
        (ground, judge_path(LSR1, ground, random_poses(k, 1000, 2.0))[0])
        for k, ground in enumerate(grounds)
    ]


@few_and_all
def test_999_in_1000_poses_settle_on_rough_ground(seeds):
    statuses = np.concatenate([prediction.status for _, prediction in rough_predictions(seeds)])
    assert set(statuses.tolist()) <= {PoseStatus.SETTLED, PoseStatus.NOT_SETTLED}
    assert (statuses == PoseStatus.SETTLED).mean() >= 0.999


@few_and_all
def test_999_of_1000_wheels_touch_within_a_tenth_of_a_millimetre_and_none_is_in_the_air(seeds):
    gaps = []
    for ground, prediction in rough_predictions(seeds):
        for k, i in enumerate(np.flatnonzero(prediction.settled)[::EVERY]):
            axis = place_rover(LSR1, prediction, i).axles[k % 6]
            gaps.append(wheel_gap(LSR1, ground, prediction.wheel_centres[i, k % 6], axis))
    gaps = np.array(gaps)
    assert gaps.size >= 39 * seeds
    assert (np.abs(gaps) <= 1e-4).mean() >= 0.999
    assert gaps.min() >= -1e-3 and gaps.max() <= 1e-4


def test_no_rim_sinks_into_steep_cells_almost_as_large_as_the_wheel():
    heights = np.random.default_rng(0).normal(0.0, 0.13, (61, 61))
    ground, poses = Terrain(heights, 0.09, (-2.7, -2.7)), random_poses(0, 40, 1.5)
    prediction = judge_poses(LSR1, ground, poses, np.zeros(len(poses)))[0]
    settled = np.flatnonzero(prediction.settled)
    assert settled.size >= 39
    gaps = np.array([wheel_gaps(LSR1, ground, prediction, i) for i in settled])
    assert gaps.min() >= -1e-4


def test_no_rim_sinks_into_cells_twenty_times_as_large_as_the_wheel():
    heights = [[-0.75, -1.22, -0.97], [-1.45, -1.37, -1.39], [-1.43, -2.79, -2.34]]
    ground = Terrain(np.array(heights), 2.0, (-2.0, -2.0))
    prediction = judge_poses(LSR1, ground, [[-0.13, 0.08, -1.24]])[0]
    assert wheel_gaps(LSR1, ground, prediction, 0).min() >= -1e-4


@both_sets
def test_contact_points_lie_on_the_wheels_and_on_the_ground(files, count):
    for case, prediction, i in waypoints_of(reference_predictions(files)):
        points, axes = prediction.contact_points[i], place_rover(LSR1, prediction, i).axles
        from_centre = points - prediction.wheel_centres[i]
        along = np.einsum("wk,wk->w", from_centre, axes)
        radial = np.linalg.norm(from_centre - along[:, None] * axes, axis=1)
        assert radial == pytest.approx(LSR1.wheel.radius, abs=1e-12)
        assert (np.abs(along) <= 0.5 * LSR1.wheel.width + 1e-12).all()
        heights = case.terrain.elevation_at(points[:, 0], points[:, 1])
        assert points[:, 2] == pytest.approx(heights, abs=0.01)


@settings(max_examples=10)
@given(slopes, slopes, st.floats(-5.0, 5.0), st.floats(-np.pi, np.pi))
def test_on_a_plane_the_rover_lies_like_the_plane(slope_x, slope_y, height, yaw):
    prediction = judge_path(LSR1, plane(slope_x, slope_y, height), [[0.1, -0.05, yaw]])[0]
    assert prediction.settled.all()
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    assert attitude_of(prediction, 0)[:, 2] == pytest.approx(normal, abs=ANGLE)
    assert prediction.rocker_angle[0] == pytest.approx([0.0, 0.0], abs=ANGLE)
    assert prediction.bogie_angle[0] == pytest.approx([0.0, 0.0], abs=ANGLE)
    axle = attitude_of(prediction, 0)[:, 1]  # contact angles are about it, from the level
    ahead = np.array([axle[1], -axle[0], 0.0]) / np.hypot(axle[0], axle[1])
    assert np.sin(prediction.contact_angle[0]) == pytest.approx(-normal @ ahead, abs=0.01)
    foot = prediction.position[0] - normal * 0.30
    assert foot[2] == pytest.approx(slope_x * foot[0] + slope_y * foot[1] + height, abs=2.0 * GAP)


LEVEL = plane(0.0, 0.0)
LEFT = raised(LEVEL, np.s_[:, 46:], np.nan)
"""Ground that is known up to x = 0.6."""
REACH = LEVEL.bounds[1] - 0.5
"""Where the front wheels touch the last cell of the map."""


@pytest.mark.parametrize(
    ("ground", "x", "status"),
    [
        (LEFT, 0.0, PoseStatus.SETTLED),
        (LEFT, 0.3, PoseStatus.UNKNOWN_GROUND),
        # Off the map comes before unknown ground.
        (raised(LEVEL, np.s_[:, 56:], np.nan), 0.95, PoseStatus.OFF_MAP),
        (LEVEL, REACH - 0.001, PoseStatus.SETTLED),
        (LEVEL, REACH + 0.001, PoseStatus.OFF_MAP),
        (LEVEL, 40.0, PoseStatus.OFF_MAP),
    ],
)
def test_wheels_over_unknown_ground_and_off_the_map_are_told_apart(ground, x, status):
    assert judge_path(LSR1, ground, [[x, 0.0, 0.0]])[0].status.tolist() == [status]


def test_a_rover_never_settles_turned_over():
    prediction = judge_path(LSR1, fractal(3, roughness=0.5), random_poses(3, 300, 1.9))[0]
    assert (prediction.status == PoseStatus.NOT_SETTLED).any()
    turned = np.maximum(np.abs(prediction.roll), np.abs(prediction.pitch))
    assert np.nanmax(turned) < 0.5 * np.pi


def test_poses_that_do_not_settle_have_nan_for_every_number():
    prediction = judge_path(LSR1, LEVEL, [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])[0]
    for one in QUANTITIES:
        values = getattr(prediction, one.name)
        if not (one.of_motion or one.of_path) or one.name in ("time", "energy"):
            assert np.isfinite(values[0]).all() and np.isnan(values[1]).all(), one.name


COARSE = 0.05 * (-3.5 + np.arange(9.0))
"""Heights of a slope on cells larger than the belly [m]."""


@pytest.mark.parametrize(
    ("ground", "clearance"),
    [
        (raised(LEVEL, (30, 30), np.nan), 0.24),  # unknown cells are passed over
        (raised(LEVEL, np.s_[25:36, 22:39], np.nan), np.nan),  # all cells below the belly
        (Terrain(np.zeros((9, 9)), 1.0, (-3.5, -3.5)), 0.24),
        (Terrain(np.tile(COARSE, (9, 1)), 1.0, (-3.5, -3.5)), 0.24 / np.cos(np.arctan(0.05))),
    ],
)
def test_it_is_the_height_of_the_belly_above_the_highest_known_ground_below(ground, clearance):
    prediction = judge_path(LSR1, ground, [[0.0, 0.0, 0.0]])[0]
    assert prediction.settled.all()
    apart = 1e-6 if prediction.pitch[0] == pytest.approx(0.0, abs=1e-9) else 1e-4
    assert prediction.belly_clearance[0] == pytest.approx(clearance, abs=apart, nan_ok=True)


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.sampled_from([smooth, rocky]))
def test_it_is_what_a_look_at_every_cell_gives(seed, make):
    ground = make(seed)
    prediction = judge_poses(LSR1, ground, random_poses(seed, 2, 0.6), np.zeros(2))[0]
    rows, columns = ground.resolution * np.indices(ground.elevation.shape)
    x, y = ground.origin[0] + columns, ground.origin[1] + rows
    for i in np.flatnonzero(prediction.settled):
        R, origin = attitude_of(prediction, i), prediction.position[i]
        belly_z = (-0.06 - R[0, 2] * (x - origin[0]) - R[1, 2] * (y - origin[1])) / R[2, 2]
        place = np.stack([x - origin[0], y - origin[1], belly_z], axis=-1) @ R
        below = (np.abs(place[..., 0]) <= 0.30) & (np.abs(place[..., 1]) <= 0.20)
        heights = (origin[2] + belly_z - ground.elevation)[below]
        assert prediction.belly_clearance[i] == pytest.approx(heights.min(), abs=1e-9)


def test_it_stays_within_its_bounds_between_cells_larger_than_the_belly():
    ground = Terrain(np.zeros((9, 9)), 1.0, (-3.5, -3.5), elevation_std=np.full((9, 9), 0.001))
    prediction, verdict = judge_path(LSR1, ground, [[0.0, 0.0, 0.3]])
    low, high = prediction.bounds.belly_clearance[0]
    assert low < prediction.belly_clearance[0] < high
    assert low == pytest.approx(0.24, abs=0.02) and high == pytest.approx(0.24, abs=0.02)
    assert verdict.traversable
