"""Tests of a rover's place on its plan."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rover_planner.planning.plan_progress import PlanProgress

STRAIGHT = np.column_stack([np.linspace(0.0, 3.0, 31), np.zeros(31), np.zeros(31)])
TURN = np.column_stack([np.full(9, 3.0), np.zeros(9), np.linspace(0.0, 2.0, 9)])
BACK = np.column_stack([np.linspace(3.0, 0.0, 31), np.zeros(31), np.zeros(31)])


def test_the_rest_of_a_plan_begins_where_the_rover_is():
    progress = PlanProgress(STRAIGHT)
    for x in (0.3, 0.9, 1.52):
        progress.advance(np.array([x, 0.04, 0.05]))
        assert abs(progress.rest[0, 0] - x) < 0.06
    assert not progress.is_over(np.array([1.5, 0.0, 0.0]), 0.2)


@given(st.lists(st.floats(-0.1, 0.3), min_size=1, max_size=40))
def test_it_never_goes_back(steps):
    progress, x, before = PlanProgress(STRAIGHT), 0.0, len(STRAIGHT)
    for step in steps:
        x = min(max(x + step, 0.0), 3.0)
        progress.advance(np.array([x, 0.0, 0.0]))
        assert len(progress.rest) <= before
        before = len(progress.rest)


def test_a_plan_that_comes_back_to_its_start_is_not_over_before_it_was_driven():
    plan = np.concatenate([STRAIGHT, BACK[1:]])
    progress, start = PlanProgress(plan), np.zeros(3)
    progress.advance(start)
    assert not progress.is_over(start, 0.2)
    for x in [*np.arange(0.0, 3.0, 0.1), *np.arange(3.0, -0.05, -0.1)]:
        progress.advance(np.array([x, 0.0, 0.0]))
    assert progress.is_over(start, 0.2)


def test_a_turn_on_the_spot_at_the_end_is_driven_before_the_plan_is_over():
    progress = PlanProgress(np.concatenate([STRAIGHT, TURN[1:]]))
    for x in np.arange(0.0, 3.01, 0.1):
        progress.advance(np.array([x, 0.0, 0.0]))
    assert not progress.is_over(np.array([3.0, 0.0, 0.0]), 0.2)
    for yaw in np.arange(0.0, 2.01, 0.2):
        progress.advance(np.array([3.0, 0.0, yaw]))
    assert progress.is_over(np.array([3.0, 0.0, 2.0]), 0.2)
