# SPDX-License-Identifier: Apache-2.0
"""Tests of how tightly a rover turns."""

import dataclasses
import math

import numpy as np
import pytest

from rover_physics.numerics.records import new_record
from rover_physics.rover.linkage import LINKAGE, pack_linkage
from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steering import steer_wheels
from rover_physics.rover.steering_joints import can_turn_on_the_spot, tightest_radius


def with_limit(name, limit):
    rover = load_rover(name)
    return dataclasses.replace(rover, steering=dataclasses.replace(rover.steering, limit=limit))


def can_drive(rover, radius):
    linkage = pack_linkage(rover, rover.masses.body.mass, np.array(rover.masses.body.com))
    assert isinstance(linkage, type(new_record(LINKAGE)))
    motion = np.array([0.03, 0.0, 0.03 / radius])
    return steer_wheels(linkage, motion, np.empty(6), np.empty(6))


def test_a_rover_with_fixed_wheels_drives_curves_of_its_wheelbase():
    rover = dataclasses.replace(load_rover("lsr1"), steering=None)
    assert tightest_radius(rover) == pytest.approx(0.8)
    assert not can_turn_on_the_spot(rover)


@pytest.mark.parametrize("name", ["lsr1", "m2020"])
@pytest.mark.parametrize("limit", [0.2, 1.2])
def test_the_wheels_reach_their_limit_on_the_tightest_curve(name, limit):
    rover = with_limit(name, limit)
    radius = tightest_radius(rover)
    assert can_drive(rover, 1.001 * radius)
    assert not can_drive(rover, 0.99 * radius)


def test_wheels_that_turn_by_a_quarter_let_the_inner_wheels_stand():
    assert tightest_radius(with_limit("lsr1", 1.57)) == pytest.approx(0.31)
    assert tightest_radius(with_limit("m2020", math.pi)) == pytest.approx(1.063)


def test_a_rover_turns_on_the_spot_if_its_wheels_reach_the_tangent():
    needed = math.atan2(0.40, 0.31)
    assert can_turn_on_the_spot(with_limit("lsr1", needed + 1e-6))
    assert not can_turn_on_the_spot(with_limit("lsr1", needed - 1e-6))
