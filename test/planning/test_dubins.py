# SPDX-License-Identifier: Apache-2.0
"""Dubins paths end at the goal, and the shortest is as long as it should be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_planner.planning.dubins import dubins_paths

POSES = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-6.3, 6.3))


@settings(max_examples=50, deadline=None)
@given(POSES, POSES, st.floats(0.2, 3.0))
def test_every_dubins_word_ends_at_the_goal(start, goal, radius):
    start, goal = np.array(start), np.array(goal)
    paths = dubins_paths(start, goal, radius, 0.1)
    assert 2 <= len(paths) <= 6
    for x, y, yaw in paths:
        assert x[-1] == pytest.approx(goal[0], abs=1e-6)
        assert y[-1] == pytest.approx(goal[1], abs=1e-6)
        assert np.cos(yaw[-1] - goal[2]) == pytest.approx(1.0, abs=1e-12)


def test_the_shortest_dubins_path_of_a_known_case_has_the_known_length():
    # facing each other's back across two radii: half a turn is the whole path
    x, y, _ = dubins_paths(np.zeros(3), np.array([0.0, 2.0, np.pi]), 1.0, 1e-3)[0]
    assert np.hypot(np.diff(x), np.diff(y)).sum() == pytest.approx(np.pi, rel=1e-6)
