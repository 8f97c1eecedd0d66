# SPDX-License-Identifier: Apache-2.0
"""Stability: the published check value, one on flat ground, and zero where the wheels lift."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.forces.stability import tip_over_angles
from rover_physics.rover.rover_file import load_rover
from rover_physics.traversability.judge import judge_path
from support.rough_grounds import plane

LSR1 = load_rover("lsr1")
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
DOWN = np.array([0.0, 0.0, -9.81])
NONE = np.zeros(3)
few = settings(max_examples=25, deadline=None)


def test_the_unit_square_has_the_check_value():
    angle, measure = tip_over_angles(SQUARE, np.array([0.5, 0.5, 1.0]), DOWN, NONE)
    assert angle == pytest.approx(0.46365, abs=5e-6)
    assert measure == pytest.approx(2.27419, abs=5e-6)


@few
@given(st.floats(-np.pi, np.pi), st.floats(0.2, 3.0))
def test_a_force_that_points_out_of_the_polygon_is_negative_by_both(direction, height):
    centre = np.array([0.5, 0.5, height])
    reach = 0.5 / max(abs(np.cos(direction)), abs(np.sin(direction)))
    aside = 9.81 * reach / height * np.array([np.cos(direction), np.sin(direction), 0.0])
    within = tip_over_angles(SQUARE, centre, DOWN + 0.98 * aside, NONE)
    beyond = tip_over_angles(SQUARE, centre, DOWN + 1.02 * aside, NONE)
    assert min(within) > 0.0
    assert max(beyond) < 0.0


def test_a_moment_that_turns_over_the_nearest_edge_takes_from_the_margin():
    centre = np.array([0.5, 0.3, 1.0])  # nearest to the edge y = 0; +x lifts the other side

    def angle(moment):
        return tip_over_angles(SQUARE, centre, DOWN, np.array([moment, 0.0, 0.0]))[0]

    tipping = 0.3 * 9.81
    assert angle(0.3 * tipping) < angle(0.0) < angle(-0.3 * tipping)
    assert angle(tipping) == pytest.approx(0.0, abs=1e-12)
    assert angle(1.01 * tipping) < 0.0 < angle(0.99 * tipping)
    turned = tip_over_angles(SQUARE, centre, DOWN, np.array([0.0, 0.0, 5.0]))
    assert turned[0] == pytest.approx(angle(0.0))  # a moment about the vertical tips nothing


@pytest.mark.parametrize("preset", ["lsr1", "m2020"])
def test_on_flat_ground_both_measures_are_one(preset):
    rover = load_rover(preset)
    prediction = judge_path(rover, plane(0.0, 0.0, half=3.0), [[0.1, 0, 0], [0, 0.2, 1.0]])[0]
    assert prediction.tip_over_ratio == pytest.approx([1.0, 1.0], abs=1e-9)
    assert prediction.tip_over_force_angle == pytest.approx([1.0, 1.0], abs=1e-9)


@pytest.mark.parametrize(
    ("rise", "yaw", "upper", "apart"),
    [
        ((-1.0, 0.0), 0.0, [0, 3], 3.0),
        ((0.0, 1.0), 0.0, [3, 4, 5], 0.5),
        ((0.0, 1.0), np.pi, [0, 1, 2], 0.5),
    ],
    ids=["downhill", "left side up", "right side up"],
)
def test_the_ratio_is_zero_about_where_the_upper_wheels_lift(rise, yaw, upper, apart):
    angles = np.arange(40.0, 66.0, 0.2)
    margins, loads = [], []
    for slope in np.tan(np.radians(angles)):
        ground = plane(slope * rise[0], slope * rise[1])
        prediction = judge_path(LSR1, ground, [[0.0, 0.0, yaw]])[0]
        margins.append(prediction.tip_over_ratio[0])
        loads.append(prediction.wheel_loads[0, upper].sum())
    tipped, lifted = (angles[np.argmax(np.array(v) <= 0.0)] for v in (margins, loads))
    assert 40.0 < tipped < 65.0
    assert tipped == pytest.approx(lifted, abs=apart)
