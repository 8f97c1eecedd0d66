# SPDX-License-Identifier: Apache-2.0
"""Paths near a refused one keep start and goal, and their headings lead along them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_planner.advice import path_changes
from rover_planner.angles import wrap
from support.paths import arc_of

S = np.linspace(0.0, 8.0, 401)
PLACE = 200
bends = st.floats(-0.15, 0.15)
offsets = st.floats(-1.0, 1.0)


CHANGES = {
    "shift": lambda path, amount: path_changes.shift_path(path, PLACE, amount, 0.8),
    "turn": lambda path, amount: path_changes.turn_path(path, PLACE, 0.4 * amount, 0.8),
    "bend": path_changes.bend_path,
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
@given(bend=bends, offset=offsets)
def test_a_shifted_path_keeps_its_ends_and_is_driven_ahead(change, bend, offset):
    path = arc_of(bend, S)
    changed = change(path, offset)
    assert changed.shape == path.shape
    np.testing.assert_array_equal(changed[[0, -1]], path[[0, -1]])
    steps = np.diff(changed[:, :2], axis=0)
    halfway = changed[:-1, 2] + 0.5 * wrap(np.diff(changed[:, 2]))
    aside = wrap(np.arctan2(steps[:, 1], steps[:, 0]) - halfway)
    assert np.abs(aside).max() < 0.02


@given(bend=bends, offset=offsets)
def test_a_shift_is_that_far_to_the_left_at_its_place(bend, offset):
    path = arc_of(bend, S)
    for changed in (
        path_changes.shift_path(path, PLACE, offset, 0.8),
        path_changes.bend_path(path, offset),
    ):
        x, y, yaw = path[PLACE]
        dx, dy = changed[PLACE, :2] - (x, y)
        assert dy * np.cos(yaw) - dx * np.sin(yaw) == pytest.approx(offset, abs=1e-9)


def test_there_is_no_room_for_a_shift_at_an_end():
    assert path_changes.shift_path(arc_of(0.0, S), 30, 0.3, 0.8) is None
    assert path_changes.turn_path(arc_of(0.0, S), 390, 0.3, 0.8) is None


def test_a_rover_that_turns_round_is_at_the_same_places_and_ends_as_it_began():
    path = arc_of(0.1, S)
    turned = path_changes.reverse_rover(path, 0.1)
    np.testing.assert_allclose(turned[0], path[0])
    np.testing.assert_allclose(turned[-1, :2], path[-1, :2])
    assert wrap(turned[-1, 2] - path[-1, 2]) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.diff(turned[:, 2])).max() <= 0.1 + 1e-9


def test_a_path_past_a_place_goes_there_and_on():
    path = path_changes.pass_by(arc_of(0.0, S), PLACE, 0.5, 0.6, 0.02)
    assert np.hypot(*(path[:, :2] - (4.0, 0.5)).T).min() < 1e-9
    np.testing.assert_allclose(path[[0, -1]], arc_of(0.0, S)[[0, -1]], atol=1e-9)


def test_turns_on_the_spot_and_reverse_driving_are_not_driven_ahead():
    assert path_changes.is_driven_ahead(arc_of(0.1, S))
    assert not path_changes.is_driven_ahead(path_changes.reverse_rover(arc_of(0.1, S), 0.1))
    assert not path_changes.is_driven_ahead(arc_of(0.1, S) + np.array([0.0, 0.0, np.pi]))
