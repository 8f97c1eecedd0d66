"""Settling: all six wheels touch, where MuJoCo says, and the ground's symmetries hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.prediction.sweep import sweep_path, sweep_poses
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from support.reference_cases import angle_errors, reference_grounds, reference_predictions
from support.rough_grounds import fractal, mirrored, plane, quarter_turn, random_poses, smooth
from support.rover_geometry import attitude_of, place_rover, wheel_gaps

LSR1 = load_rover("lsr1")
GAP = 3e-5  # what a settled pose may leave open [m]
ANGLE = 4.0 * GAP / 0.4  # and what that may turn [rad]
SWAP = [3, 4, 5, 0, 1, 2]
slopes = st.floats(-0.4, 0.4)
headings = st.floats(-np.pi, np.pi)
seeds = st.integers(0, 10_000)
AHEAD = np.zeros(
    4
)  # curvatures: single poses, as a path through them may ask for more than wheels turn
few = settings(max_examples=25, deadline=None)


def wheel_centre_errors() -> np.ndarray:
    errors = [
        np.linalg.norm(prediction.wheel_centres - case.wheel_centres, axis=2).ravel()
        for case, prediction in reference_predictions()
    ]
    return np.concatenate(errors)


def every_waypoint():
    for case, prediction in reference_predictions():
        for i in range(len(prediction.poses)):
            yield case, prediction, i


# Against the reference


def test_there_are_81_reference_cases_on_7_grounds_in_each_of_two_files():
    assert len(reference_grounds()) == 14
    assert sum(len(case.poses) for case in reference_grounds()) == 81


def test_every_reference_case_settles():
    for case, prediction in reference_predictions():
        assert prediction.settled.all(), case.label


def test_wheel_centres_are_where_mujoco_has_them():
    errors = wheel_centre_errors()
    assert errors.size == 81 * 6
    assert np.median(errors) <= 0.5e-3
    assert np.percentile(errors, 95) <= 2.5e-3


def test_attitude_and_suspension_angles_are_those_of_mujoco():
    errors = angle_errors(reference_predictions())
    assert np.median(errors) <= 0.5e-3
    assert np.percentile(errors, 95) <= 5e-3


# The gaps are closed


def test_wheels_touch_by_an_independent_dense_look_over_their_whole_width():
    gaps = np.concatenate(
        [wheel_gaps(LSR1, case.terrain, prediction, i) for case, prediction, i in every_waypoint()]
    )
    assert gaps.max() <= 3e-4
    assert (np.abs(gaps) <= 1e-4).mean() >= 0.99
    assert gaps.min() >= -1e-3


def test_contact_points_lie_on_the_wheels_and_on_the_ground():
    for case, prediction, i in every_waypoint():
        points = prediction.contact_points[i]
        axis = attitude_of(prediction, i)[:, 1]
        from_centre = points - prediction.wheel_centres[i]
        along = from_centre @ axis
        radial = np.linalg.norm(from_centre - along[:, None] * axis, axis=1)
        assert radial == pytest.approx(LSR1.wheel.radius, abs=1e-12)
        assert (np.abs(along) <= 0.5 * LSR1.wheel.width + 1e-12).all()
        heights = case.terrain.elevation_at(points[:, 0], points[:, 1])
        assert points[:, 2] == pytest.approx(heights, abs=0.01)


# Kinematics


@pytest.mark.parametrize("preset", ["lsr1", "m2020"])
def test_wheel_centres_follow_from_pose_and_suspension_angles(preset):
    rover = load_rover(preset)
    size = rover.wheel.radius / 0.10
    ground = fractal(3)
    ground = Terrain(ground.elevation * size, ground.resolution * size)
    middle = 0.5 * ground.bounds[1]
    poses = random_poses(1, 20, 0.8 * size) + np.array([middle, middle, 0.0])
    prediction = sweep_path(rover, ground, poses)
    assert prediction.settled.all()
    for i in range(20):
        wheels = place_rover(rover, prediction, i).wheels
        assert prediction.wheel_centres[i] == pytest.approx(wheels, abs=1e-12 * size)


# Planes and symmetries


@few
@given(slopes, slopes, st.floats(-5.0, 5.0), headings)
def test_on_a_plane_the_rover_lies_like_the_plane(slope_x, slope_y, height, yaw):
    prediction = sweep_path(LSR1, plane(slope_x, slope_y, height), [[0.1, -0.05, yaw]])
    assert prediction.settled.all()
    R = attitude_of(prediction, 0)
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    assert R[:, 2] == pytest.approx(normal, abs=ANGLE)
    assert prediction.rocker_angle[0] == pytest.approx([0.0, 0.0], abs=ANGLE)
    assert prediction.bogie_angle[0] == pytest.approx([0.0, 0.0], abs=ANGLE)
    foot = prediction.position[0] - normal * 0.30
    assert foot[2] == pytest.approx(slope_x * foot[0] + slope_y * foot[1] + height, abs=2.0 * GAP)


@few
@given(seeds, st.integers(1, 3))
def test_turned_by_quarters_with_its_path_the_ground_changes_nothing(seed, quarters):
    ground, poses = smooth(seed), random_poses(seed, 4, 0.6)
    turned_ground, turned_poses = ground, poses
    for _ in range(quarters):
        turned_ground, turned_poses = quarter_turn(turned_ground, turned_poses)
    here = sweep_poses(LSR1, ground, poses, AHEAD)
    assert here.settled.all()
    there = sweep_poses(LSR1, turned_ground, turned_poses, AHEAD)
    for name in ("status", "roll", "pitch", "rocker_angle", "bogie_angle"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), abs=ANGLE), name
    assert there.position[:, 2] == pytest.approx(here.position[:, 2], abs=2.0 * GAP)
    assert there.wheel_loads == pytest.approx(here.wheel_loads, abs=1e-3 * LSR1.weight)


@few
@given(seeds)
def test_mirrored_ground_swaps_right_and_left(seed):
    ground, poses = smooth(seed), random_poses(seed, 4, 0.6)
    here = sweep_poses(LSR1, ground, poses, AHEAD)
    assert here.settled.all()
    there = sweep_poses(LSR1, *mirrored(ground, poses), AHEAD)
    assert there.status.tolist() == here.status.tolist()
    assert there.position[:, 2] == pytest.approx(here.position[:, 2], abs=2.0 * GAP)
    assert there.roll == pytest.approx(-here.roll, abs=ANGLE)
    assert there.pitch == pytest.approx(here.pitch, abs=ANGLE)
    assert there.rocker_angle == pytest.approx(here.rocker_angle[:, ::-1], abs=ANGLE)
    assert there.bogie_angle == pytest.approx(here.bogie_angle[:, ::-1], abs=ANGLE)
    centres = here.wheel_centres[:, SWAP] * [1.0, -1.0, 1.0]
    assert there.wheel_centres == pytest.approx(centres, abs=ANGLE)


@few
@given(seeds, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_moved_with_its_path_the_ground_changes_nothing(seed, dx, dy, dz):
    ground, poses = smooth(seed), random_poses(seed, 4, 0.6)
    x, y = ground.origin
    moved = Terrain(ground.elevation + dz, ground.resolution, (x + dx, y + dy))
    shift = np.array([dx, dy, dz])
    here = sweep_poses(LSR1, ground, poses, AHEAD)
    assert here.settled.all()
    there = sweep_poses(LSR1, moved, poses + np.array([dx, dy, 0.0]), AHEAD)
    assert there.position == pytest.approx(here.position + shift, abs=2.0 * GAP)
    assert there.roll == pytest.approx(here.roll, abs=ANGLE)
    assert there.bogie_angle == pytest.approx(here.bogie_angle, abs=ANGLE)


@few
@given(seeds, headings)
def test_the_differential_turns_the_rockers_against_each_other(seed, yaw):
    prediction = sweep_path(LSR1, smooth(seed), [[0.0, 0.0, yaw]])
    assert prediction.rocker_angle[0, 1] == -prediction.rocker_angle[0, 0]


# It settles nearly everywhere, and says so where it doesn't


def known_to_the_left_of(x_edge: float) -> Terrain:
    ground = plane(0.0, 0.0)
    elevation = ground.elevation.copy()
    elevation[:, ground.origin[0] + np.arange(elevation.shape[1]) * ground.resolution > x_edge] = (
        np.nan
    )
    return Terrain(elevation, ground.resolution, ground.origin)


def test_a_wheel_over_unknown_ground_is_told():
    prediction = sweep_path(LSR1, known_to_the_left_of(0.6), [[0.0, 0, 0], [0.3, 0, 0]])
    assert prediction.status.tolist() == [PoseStatus.SETTLED, PoseStatus.UNKNOWN_GROUND]
    assert prediction.settled.tolist() == [True, False]


def test_a_wheel_off_the_map_is_told():
    prediction = sweep_path(LSR1, plane(0.0, 0.0), [[0.0, 0, 0], [0.9, 0, 0], [40.0, 0, 0]])
    assert prediction.status.tolist() == [
        PoseStatus.SETTLED,
        PoseStatus.OFF_MAP,
        PoseStatus.OFF_MAP,
    ]


def test_off_the_map_comes_before_unknown_ground():
    ground = known_to_the_left_of(1.0)
    prediction = sweep_path(LSR1, ground, [[0.95, 0.0, 0.0]])
    assert prediction.status.tolist() == [PoseStatus.OFF_MAP]


def test_the_map_may_be_used_up_to_its_last_cell():
    reach = plane(0.0, 0.0).bounds[1] - 0.5
    on_the_edge = sweep_path(
        LSR1, plane(0.0, 0.0), [[reach - 0.001, 0.0, 0.0], [reach + 0.001, 0.0, 0.0]]
    )
    assert on_the_edge.status.tolist() == [PoseStatus.SETTLED, PoseStatus.OFF_MAP]


def test_a_wall_across_the_rover_is_never_settled_by_a_guess():
    x = (np.arange(121) - 60) * 0.04
    wall = np.where(np.abs(x) < 0.10, 1.5, 0.0)
    ground = Terrain(np.broadcast_to(wall, (121, 121)).copy(), 0.04, (x[0], x[0]))
    poses = np.column_stack([np.linspace(-0.6, 0.6, 60), np.zeros((60, 2))])
    prediction = sweep_path(LSR1, ground, poses)
    for i in np.flatnonzero(prediction.settled):
        gaps = wheel_gaps(LSR1, ground, prediction, i)
        assert np.abs(gaps).max() <= 5e-3
    assert (prediction.status == PoseStatus.NOT_SETTLED).any()


@pytest.mark.slow
def test_a_rover_never_settles_turned_over():
    ground = fractal(3, roughness=0.5)
    prediction = sweep_path(LSR1, ground, random_poses(3, 600, 1.9))
    assert (prediction.status == PoseStatus.NOT_SETTLED).any()
    turned = np.maximum(np.abs(prediction.roll), np.abs(prediction.pitch))
    assert np.nanmax(turned) < 0.5 * np.pi


def test_poses_that_do_not_settle_have_nan_for_every_number():
    prediction = sweep_path(LSR1, plane(0.0, 0.0), [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    for name in (
        "position", "roll", "pitch", "rocker_angle", "bogie_angle", "wheel_centres",
        "contact_points", "contact_angle", "wheel_loads", "tangential", "lateral", "torque",
        "friction", "friction_utilisation", "slip_ratio", "torque_saturation", "tip_over_ratio",
        "tip_over_force_angle", "belly_clearance", "power", "energy", "time",
    ):  # fmt: skip
        values = getattr(prediction, name)
        assert np.isfinite(values[0]).all(), name
        assert np.isnan(values[1]).all(), name
