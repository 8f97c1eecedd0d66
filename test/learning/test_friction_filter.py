# SPDX-License-Identifier: Apache-2.0
"""The friction of a ground as the wheels tell it: bounds, measurements, changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_planner.learning.friction_filter import FrictionFilter

frictions = st.floats(0.15, 1.3)
TOLD, NOISE = 0.8, 0.08


def slip_on(friction: float, count: int, seed: int = 0) -> FrictionFilter:
    """Return a ground after wheels have slipped on it, with noise."""
    ground, rng = FrictionFilter(TOLD), np.random.default_rng(seed)
    for use in friction * (1.0 + NOISE * rng.standard_normal(count)):
        ground.slip(float(use), NOISE, 1.0)
    return ground


def test_nothing_is_known_before_anything_is_felt_but_what_is_told():
    estimate = FrictionFilter(TOLD).estimate
    assert estimate.mean == pytest.approx(TOLD, rel=0.03)
    assert estimate.low == 0.0 and estimate.high is None


@given(st.lists(st.floats(0.0, 1.2), min_size=1, max_size=200))
def test_wheels_that_grip_bound_the_friction_from_below_only(uses):
    ground = FrictionFilter(TOLD)
    for use in uses:
        ground.grip(use)
    estimate = ground.estimate
    assert estimate.high is None
    assert estimate.low <= max(uses)
    assert estimate.mean >= FrictionFilter(TOLD).estimate.mean - 1e-9


@given(frictions, st.integers(0, 50))
def test_wheels_that_slip_measure_the_friction(friction, seed):
    estimate = slip_on(friction, 12, seed).estimate
    assert estimate.mean == pytest.approx(friction, rel=0.15)
    assert estimate.low < estimate.mean < estimate.high


def test_the_interval_has_the_truth_in_nineteen_of_twenty_grounds():
    within = 0
    rng = np.random.default_rng(3)
    for seed in range(200):
        friction = float(rng.uniform(0.2, 1.0))
        estimate = slip_on(friction, 4, seed).estimate
        within += estimate.low <= friction <= estimate.high
    assert 180 <= within <= 199


def test_one_wrong_measurement_moves_little():
    ground = slip_on(0.5, 10)
    before = ground.estimate.mean
    ground.slip(1.1, NOISE, 1.0)
    ground.slip(0.1, NOISE, 1.0)
    assert ground.estimate.mean == pytest.approx(before, rel=0.05)


@pytest.mark.parametrize("friction", [0.3, 0.5, 1.2])
def test_the_first_measurement_is_not_drawn_towards_what_was_told(friction):
    ground = FrictionFilter(TOLD)
    while ground.estimate.high is None:
        ground.slip(friction, 0.22, 0.17)
    assert ground.estimate.mean == pytest.approx(friction, rel=0.1)


def test_a_lower_friction_is_believed_within_a_metre_after_a_line():
    ground = slip_on(0.7, 10)
    for _ in range(5):
        ground.drive(0.2)
        ground.slip(0.35, 0.22, 0.5)
    estimate = ground.estimate
    assert estimate.low < 0.35 and estimate.mean < 0.45


def test_slips_before_a_line_do_not_bound_the_ground_that_is_proved_to_be_another():
    ground = slip_on(0.26, 10)
    ground.drive(1.0)
    assert ground.estimate.high is not None
    ground.grip(0.45)
    assert ground.estimate.high is None


def test_on_ground_that_may_have_changed_since_the_measured_friction_stays_and_is_less_sure():
    ground = slip_on(0.35, 10)
    before = ground.estimate
    ground.drive(1.5)
    after = ground.estimate
    assert after.mean == pytest.approx(before.mean, rel=0.01)
    assert after.std > 2.0 * before.std
