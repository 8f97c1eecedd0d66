"""Tests of what must not change a verdict: more friction or torque, pieces of a path, a shift."""

import pytest

from benchmarks.invariants import changes_of
from rover_physics.rover.rover_file import load_rover

MAY_CHANGE = {"passes", "refining changes it"}
"""Between coarser waypoints a wheel may pass a place that is just beyond its limit."""


@pytest.mark.parametrize("name", ["lsr1", "m2020"])
@pytest.mark.parametrize("seed", [4, 7, 19, 49, 73, 78, 87])
def test_more_friction_or_torque_splitting_or_shifting_never_makes_a_verdict_worse(name, seed):
    assert set(changes_of(load_rover(name), seed)) <= MAY_CHANGE
