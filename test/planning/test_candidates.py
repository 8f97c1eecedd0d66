# SPDX-License-Identifier: Apache-2.0
"""Candidate paths meet both poses, are evenly sampled, smooth, and never too tight to drive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_planner.angles import wrap
from rover_planner.errors import PlanningError
from rover_planner.planning.candidates import MIN_RADIUS, generate_candidates, turn_and_drive
from rover_planner.planning.dubins import dubins_paths
from rover_planner.planning.path_geometry import path_length

METRES = st.floats(-20.0, 20.0)
ANGLES = st.floats(-2 * np.pi, 2 * np.pi)
POSES = st.tuples(METRES, METRES, ANGLES)
SWING, SPACING = 0.5, 0.05


def angle_between(a, b):
    return np.abs(wrap(np.asarray(a) - np.asarray(b)))


@given(POSES, POSES, st.sampled_from([0.02, 0.05, 0.13]))
def test_every_candidate_leads_from_start_to_goal_in_equal_steps(start, goal, spacing):
    paths = generate_candidates(start, goal, waypoint_spacing=spacing)
    assert 1 <= len(paths) <= 9
    for path in paths:
        assert path.flags.c_contiguous  # kernels are compiled for such arrays alone
        assert path[-1, :2] == pytest.approx(goal[:2], abs=0)
        assert angle_between(path[-1, 2], goal[2]) < 1e-9
        if len(path) > 1:
            assert path[0, :2] == pytest.approx(start[:2], abs=0)
            assert angle_between(path[0, 2], start[2]) < 1e-9
        if len(path) > 2:
            gaps = np.hypot(*np.diff(path[:, :2], axis=0).T)
            # chords of an arc of the smallest radius are shorter than the arc by this much at most
            shortening = 1 - np.sinc(gaps.max() / 2 / MIN_RADIUS / np.pi)
            assert gaps.max() <= spacing * (1 + 1e-4)
            assert gaps.max() - gaps.min() <= gaps.max() * (1e-4 + 2 * shortening)


@given(POSES, POSES)
def test_paths_point_where_they_lead_and_no_curve_is_too_tight(start, goal):
    for path in generate_candidates(start, goal):
        steps = np.diff(path[:, :2], axis=0)
        gaps = np.hypot(*steps.T)
        turned = angle_between(path[1:, 2], path[:-1, 2])
        assert np.all(turned <= gaps / MIN_RADIUS * 1.01 + 1e-6)
        along = np.arctan2(steps[:, 1], steps[:, 0])
        middle = path[:-1, 2] + 0.5 * wrap(np.diff(path[:, 2]))
        # where an arc to the left meets one to the right, half-way in yaw is not half-way in path
        assert np.all(angle_between(along, middle)[gaps > 1e-3] < 0.02 / MIN_RADIUS / 3)


def test_the_fan_spreads_by_the_spacing_to_both_sides():
    paths = generate_candidates((0, 0, 0), (10, 0, 0), count=7, spacing=0.4)
    assert np.abs(paths[0][:, 1:]).max() < 1e-12 and len(paths[0]) == 501
    furthest = [path[np.argmax(np.abs(path[:, 1])), 1] for path in paths]
    assert furthest == pytest.approx([0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2], abs=1e-3)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"start": (np.nan, 0, 0)}, "start"),
        ({"goal": (0, np.inf, 0)}, "goal"),
        ({"count": 0}, "count"),
        ({"spacing": 0.0}, "spacing"),
        ({"waypoint_spacing": -0.02}, "waypoint_spacing"),
        ({"goal": (1e9, 0, 0)}, "waypoints"),
    ],
)
def test_bad_requests_are_refused_by_name(change, names):
    with pytest.raises(PlanningError, match=names):
        generate_candidates(**({"start": (0, 0, 0), "goal": (4, 1, 0)} | change))


@given(POSES, POSES)
def test_a_point_turn_leads_from_start_to_goal_in_small_steps_that_turn_or_drive(start, goal):
    path, length = turn_and_drive(np.array(start), np.array(goal), SWING, SPACING)
    assert path[0, :2] == pytest.approx(start[:2]) and path[-1, :2] == pytest.approx(goal[:2])
    assert np.cos(path[[0, -1], 2] - (start[2], goal[2])) == pytest.approx(1.0, abs=1e-6)
    steps = np.diff(path, axis=0)
    driven, turned = np.hypot(steps[:, 0], steps[:, 1]), np.abs(wrap(steps[:, 2]))
    assert (driven <= SPACING * (1 + 1e-9)).all() and (SWING * turned <= SPACING + 1e-3).all()
    assert ((driven < 1e-12) | (turned < 2e-3)).all()
    assert length == pytest.approx(path_length(path) + SWING * turned.sum(), abs=1e-2)


def test_a_point_turn_is_a_candidate_where_it_is_shorter_than_all_curves():
    behind = (0.0, 0.0, 0.0), (-2.0, 0.0, 0.0)
    curves = generate_candidates(*behind, min_radius=0.8)
    turned = generate_candidates(*behind, min_radius=0.8, swing_radius=SWING)[-1]
    assert path_length(turned) == pytest.approx(2.0)
    assert min(path_length(path) for path in curves) > 2.0 + 2.0 * SWING * np.pi
    assert path_length(generate_candidates(*behind, count=1, swing_radius=SWING)[-1]) == 2.0
    ahead = (0.0, 0.0, 0.0), (3.0, 0.0, 0.0)
    plain, turning = (generate_candidates(*ahead, swing_radius=swing) for swing in (None, SWING))
    assert all(np.array_equal(a, b) for a, b in zip(plain, turning, strict=True))


def test_the_shortest_dubins_path_of_a_known_case_has_the_known_length():
    # facing each other's back across two radii: half a turn is the whole path
    x, y, _ = dubins_paths(np.zeros(3), np.array([0.0, 2.0, np.pi]), 1.0, 1e-3)[0].T
    assert np.hypot(np.diff(x), np.diff(y)).sum() == pytest.approx(np.pi, rel=1e-6)
