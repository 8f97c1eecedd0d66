# SPDX-License-Identifier: Apache-2.0
"""Tests of the candidate that turns on the spot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_planner.planning.angles import wrap
from rover_planner.planning.candidates import generate_candidates, path_length
from rover_planner.planning.point_turn import turn_and_drive

POSES = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.14, 3.14))
SWING, SPACING = 0.5, 0.05


@given(POSES, POSES)
def test_it_leads_from_start_to_goal_in_small_steps_that_turn_or_drive(start, goal):
    path, length = turn_and_drive(np.array(start), np.array(goal), SWING, SPACING)
    assert path[0, :2] == pytest.approx(start[:2]) and path[-1, :2] == pytest.approx(goal[:2])
    for pose, end in ((path[0], start), (path[-1], goal)):
        assert np.cos(pose[2] - end[2]) == pytest.approx(1.0, abs=1e-6)
    steps = np.diff(path, axis=0)
    driven, turned = np.hypot(steps[:, 0], steps[:, 1]), np.abs(wrap(steps[:, 2]))
    assert (driven <= SPACING * (1 + 1e-9)).all() and (SWING * turned <= SPACING + 1e-3).all()
    assert ((driven < 1e-12) | (turned < 2e-3)).all()
    assert length == pytest.approx(path_length(path) + SWING * turned.sum(), abs=1e-2)


def test_it_is_a_candidate_where_it_is_shorter_than_all_curves():
    behind = (0.0, 0.0, 0.0), (-2.0, 0.0, 0.0)
    curves = generate_candidates(*behind, min_radius=0.8)
    turned = generate_candidates(*behind, min_radius=0.8, swing_radius=SWING)[-1]
    assert path_length(turned) == pytest.approx(2.0)
    assert min(path_length(path) for path in curves) > 2.0 + 2.0 * SWING * np.pi


def test_it_is_no_candidate_where_a_straight_line_leads_to_the_goal():
    ahead = (0.0, 0.0, 0.0), (3.0, 0.0, 0.0)
    plain, turning = (generate_candidates(*ahead, swing_radius=swing) for swing in (None, SWING))
    assert all(np.array_equal(a, b) for a, b in zip(plain, turning, strict=True))


def test_the_number_of_candidates_keeps_its_bound():
    for count in (1, 2, 5):
        paths = generate_candidates((0, 0, 0), (-2, 0, 0), count=count, swing_radius=SWING)
        assert 1 <= len(paths) <= count
        assert path_length(paths[-1]) == pytest.approx(2.0)
