"""Stability: the published check value, one on flat ground, and zero where the wheels lift."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.forces.stability import tip_over_angles
from rover_physics.prediction.sweep import sweep_path, sweep_poses
from rover_physics.rover.rover_file import load_rover
from support.rough_grounds import mirrored, plane, random_poses, smooth
from support.rover_geometry import turned_round

LSR1 = load_rover("lsr1")
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
DOWN = np.array([0.0, 0.0, -9.81])
NONE = np.zeros(3)
few = settings(max_examples=25, deadline=None)


def test_the_unit_square_has_the_check_value():
    angle, measure = tip_over_angles(SQUARE, np.array([0.5, 0.5, 1.0]), DOWN, NONE)
    assert angle == pytest.approx(0.46365, abs=5e-6)
    assert measure == pytest.approx(2.27419, abs=5e-6)


def test_the_nearest_edge_counts():
    angle, _ = tip_over_angles(SQUARE, np.array([0.5, 0.2, 1.0]), DOWN, NONE)
    assert angle == pytest.approx(np.arctan(0.2))


def test_a_heavier_rover_is_harder_to_tip_by_the_measure_but_not_by_the_angle():
    centre = np.array([0.5, 0.5, 1.0])
    angle, measure = tip_over_angles(SQUARE, centre, DOWN, NONE)
    heavy_angle, heavy_measure = tip_over_angles(SQUARE, centre, 3.0 * DOWN, NONE)
    assert heavy_angle == pytest.approx(angle)
    assert heavy_measure == pytest.approx(3.0 * measure)


@few
@given(st.floats(-np.pi, np.pi), st.floats(0.2, 3.0))
def test_a_force_that_points_out_of_the_polygon_is_negative_by_both(direction, height):
    centre = np.array([0.5, 0.5, height])
    reach = 0.5 / max(abs(np.cos(direction)), abs(np.sin(direction)))
    aside = 9.81 * reach / height * np.array([np.cos(direction), np.sin(direction), 0.0])
    within = tip_over_angles(SQUARE, centre, DOWN + 0.98 * aside, NONE)
    beyond = tip_over_angles(SQUARE, centre, DOWN + 1.02 * aside, NONE)
    assert min(within) > 0.0
    assert max(beyond) < 0.0


def test_a_moment_that_turns_over_the_nearest_edge_takes_from_the_margin():
    centre = np.array([0.5, 0.3, 1.0])  # nearest to the edge y = 0; +x lifts the other side

    def angle(moment):
        return tip_over_angles(SQUARE, centre, DOWN, np.array([moment, 0.0, 0.0]))[0]

    tipping = 0.3 * 9.81
    assert angle(0.3 * tipping) < angle(0.0) < angle(-0.3 * tipping)
    assert angle(tipping) == pytest.approx(0.0, abs=1e-12)
    assert angle(1.01 * tipping) < 0.0 < angle(0.99 * tipping)


def test_a_moment_about_the_vertical_tips_nothing():
    centre = np.array([0.5, 0.3, 1.0])
    still = tip_over_angles(SQUARE, centre, DOWN, NONE)
    turning = tip_over_angles(SQUARE, centre, DOWN, np.array([0.0, 0.0, 5.0]))
    assert turning == pytest.approx(still)


@pytest.mark.parametrize("preset", ["lsr1", "m2020"])
def test_on_flat_ground_both_measures_are_one(preset):
    rover = load_rover(preset)
    prediction = sweep_path(rover, plane(0.0, 0.0, half=3.0), [[0.1, 0, 0], [0, 0.2, 1.0]])
    assert prediction.tip_over_ratio == pytest.approx([1.0, 1.0], abs=1e-9)
    assert prediction.tip_over_force_angle == pytest.approx([1.0, 1.0], abs=1e-9)


def margins_on_slopes(degrees: range, direction: float) -> np.ndarray:
    """Return ratio and force-angle measure (k, 2) on planes that rise in a direction."""
    rises = np.tan(np.radians(degrees))
    predictions = [
        sweep_path(
            LSR1, plane(rise * np.cos(direction), rise * np.sin(direction)), [[0.0, 0.0, 0.0]]
        )
        for rise in rises
    ]
    return np.array([(p.tip_over_ratio[0], p.tip_over_force_angle[0]) for p in predictions])


@pytest.mark.parametrize("direction", [np.pi / 2, -np.pi / 2])
def test_both_measures_fall_with_every_degree_of_side_slope(direction):
    ratio, measure = margins_on_slopes(range(0, 48, 3), direction).T
    assert (np.diff(measure) < 0.0).all()
    assert (np.diff(ratio[5:]) < -0.01).all()  # flatter, the front edge stays the nearest
    assert ratio[:5] == pytest.approx(np.ones(5), abs=1e-9)


def test_both_measures_fall_with_every_degree_of_downhill_slope():
    margins = margins_on_slopes(range(0, 56, 3), np.pi)
    assert (np.diff(margins, axis=0) < 0.0).all()


def test_downhill_the_ratio_is_zero_about_where_the_rear_wheels_lift():
    def first_angle(has_failed):
        for degrees in np.arange(40.0, 70.0, 0.5):
            down = plane(-np.tan(np.radians(degrees)), 0.0)
            if has_failed(sweep_path(LSR1, down, [[0.0, 0.0, 0.0]])):
                return degrees
        raise AssertionError("never")

    tipped = first_angle(lambda prediction: prediction.tip_over_ratio[0] <= 0.0)
    lifted = first_angle(lambda prediction: prediction.wheel_loads[0, [0, 3]].sum() <= 0.0)
    assert tipped == pytest.approx(lifted, abs=3.0)


def side_slope(degrees: float, yaw: float):
    slope = np.tan(np.radians(degrees))
    return sweep_path(LSR1, plane(0.0, slope), [[0.0, 0.0, yaw]])


@pytest.mark.parametrize(("yaw", "upper"), [(0.0, slice(3, 6)), (np.pi, slice(0, 3))])
def test_on_a_side_slope_the_ratio_is_zero_where_the_upper_wheels_lift(yaw, upper):
    def first_angle(has_failed):
        return next(a for a in np.arange(30.0, 60.0, 0.1) if has_failed(side_slope(a, yaw)))

    tipped = first_angle(lambda prediction: prediction.tip_over_ratio[0] <= 0.0)
    lifted = first_angle(lambda prediction: prediction.wheel_loads[0, upper].sum() <= 0.0)
    assert tipped == pytest.approx(lifted, abs=0.5)
    assert 40.0 < tipped < 58.0


@few
@given(st.integers(0, 10_000))
def test_mirrored_ground_has_the_same_margins(seed):
    ground, poses = smooth(seed), random_poses(seed, 3, 0.6)
    here = sweep_poses(LSR1, ground, poses, np.zeros(3))
    there = sweep_poses(LSR1, *mirrored(ground, poses), np.zeros(3))
    assert there.tip_over_ratio == pytest.approx(here.tip_over_ratio, abs=1e-4)
    assert there.tip_over_force_angle == pytest.approx(here.tip_over_force_angle, abs=1e-4)


def test_a_bogie_behind_tips_down_the_slope_that_tips_a_bogie_ahead_up_it():
    rover, ground = turned_round(LSR1), plane(0.5, 0.0)
    ahead = sweep_path(LSR1, ground, [[0.0, 0.0, 0.0], [0.0, 0.0, np.pi]]).tip_over_ratio
    behind = sweep_path(rover, ground, [[0.0, 0.0, np.pi], [0.0, 0.0, 0.0]]).tip_over_ratio
    assert behind == pytest.approx(ahead, abs=1e-4)
    assert abs(ahead[0] - ahead[1]) > 0.01
