# SPDX-License-Identifier: Apache-2.0
"""What is searched between waypoints does not depend on how it is searched."""

import numpy as np
import pytest

from rover_physics.prediction import crossing
from rover_physics.prediction.crossing import find_crossings
from rover_physics.prediction.halving import AtFailure
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.results.record import numbers_of
from rover_physics.results.uses import find_codes
from support.paths import poses_at
from support.rough_grounds import rocky
from support.rovers import LSR1

MODEL, WAY = pack_model(LSR1, rocky(5)), poses_at(np.linspace(-1.0, 1.0, 101))
"""A path that fails between its waypoints only."""


@pytest.fixture(scope="module")
def results():
    return MODEL.evaluate(WAY, motions=motions_of(MODEL, WAY))


def assert_same(one, other):
    for part, same in zip(one[:-1], other[:-1], strict=True):
        np.testing.assert_array_equal(part, same)
    # The first number holds the status and unused bytes.
    np.testing.assert_array_equal(numbers_of(one.results)[:, 1:], numbers_of(other.results)[:, 1:])
    np.testing.assert_array_equal(one.results["status"], other.results["status"])


def test_behind_a_failure_nothing_is_searched_and_up_to_it_all(results):
    whole, rest, path = (find_crossings(MODEL, WAY, results, True, at) for at in AtFailure)
    assert not any(find_codes(MODEL.limits, results))
    assert len(path.place) < len(rest.place) < 0.8 * len(whole.place)
    fails = np.array(find_codes(MODEL.limits, whole.results)) != ""
    first = whole.waypoint[fails].min()
    assert_same(rest.select(rest.waypoint <= first), whole.select(whole.waypoint <= first))


def test_groups_and_little_space_change_nothing(results, monkeypatch):
    whole = find_crossings(MODEL, WAY, results)
    monkeypatch.setattr(crossing, "GROUP", 3)
    monkeypatch.setattr(crossing, "POSES_IN_STRETCH", 1)
    assert_same(find_crossings(MODEL, WAY, results), whole)
