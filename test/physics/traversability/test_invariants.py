# SPDX-License-Identifier: Apache-2.0
"""Tests of what must not change a verdict: friction, torque, pieces, a shift, more waypoints."""

import pytest

from benchmarks.invariants import changes_of
from rover_physics.rover.rover_file import load_rover

MAY_CHANGE = {"passes", "refining changes it"}
"""Peaks of forces between waypoints are found to a few per cent of a limit."""


@pytest.mark.parametrize("name", ["lsr1", "m2020"])
@pytest.mark.parametrize("seed", [4, 49, 78])
def test_more_friction_or_torque_splitting_or_shifting_never_makes_a_verdict_worse(name, seed):
    assert set(changes_of(load_rover(name), seed)) <= MAY_CHANGE


@pytest.mark.parametrize(
    "name, seed",
    [("lsr1", seed) for seed in (34, 215, 830)] + [("m2020", seed) for seed in (57, 230, 695)],
)
def test_twice_as_many_waypoints_change_no_verdict(name, seed):
    """Each of them hid a peak of friction, or the begin of a fall, between its waypoints."""
    assert set(changes_of(load_rover(name), seed)) <= {"passes"}
