# SPDX-License-Identifier: Apache-2.0
"""Tests of the motion primitives: they join nodes, and the rover can drive them."""

import numpy as np
import pytest

from rover_physics import load_rover
from rover_physics.rover.steering_joints import tightest_radius
from rover_planner.angles import wrap
from rover_planner.planning.search.edges import Gear, make_primitives
from rover_planner.planning.search.nodes import HEADINGS, YAWS
from support.rovers import FIXED, LSR1

SPACING = 0.02


def all_of(rover, cell):
    table = make_primitives(rover, cell, SPACING)
    return [(h, one) for h in range(HEADINGS) for one in table[h]]


@pytest.mark.parametrize(
    ("rover", "cell"),
    [(LSR1, 0.1), (FIXED, 0.2), (load_rover("m2020"), 0.565)],
    ids=["small cells", "fixed wheels", "m2020"],
)
def test_a_primitive_joins_two_nodes_within_spacing_and_steering(rover, cell):
    radius = tightest_radius(rover)
    for heading, one in all_of(rover, cell):
        poses, steps = one.poses, np.diff(one.poses, axis=0)
        np.testing.assert_allclose(poses[0, :2], 0.0, atol=1e-12)
        assert abs(wrap(poses[0, 2] - YAWS[heading])) < 1e-12
        np.testing.assert_allclose(poses[-1, :2], cell * np.array(one.step), atol=1e-9)
        assert abs(wrap(poses[-1, 2] - YAWS[one.end_heading])) < 1e-9
        way = np.hypot(steps[:, 0], steps[:, 1])
        assert way.max() <= SPACING + 1e-9
        if one.gear != Gear.ON_THE_SPOT:
            assert way.sum() == pytest.approx(one.length, rel=2e-3)
            assert (np.abs(steps[:, 2]) * radius <= 1.01 * way + 1e-9).all()


def test_a_primitive_is_driven_in_its_gear_and_fixed_wheels_do_not_turn_on_the_spot():
    assert {one.gear for _, one in all_of(FIXED, 0.2)} == {Gear.FORWARD, Gear.BACKWARD}
    for _, one in all_of(LSR1, 0.2):
        steps, middle = np.diff(one.poses, axis=0), 0.5 * (one.poses[1:, 2] + one.poses[:-1, 2])
        ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
        aside = steps[:, 1] * np.cos(middle) - steps[:, 0] * np.sin(middle)
        sign = {Gear.FORWARD: 1.0, Gear.BACKWARD: -1.0, Gear.ON_THE_SPOT: 0.0}[one.gear]
        np.testing.assert_array_equal(np.sign(np.round(ahead, 12)), sign)
        np.testing.assert_allclose(aside, 0.0, atol=5e-3 * SPACING)
