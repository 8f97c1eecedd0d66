"""One wheel on a speed servo: forces of servo line and friction law, and their derivatives."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from rover_physics.forces.servo_record import SERVO
from rover_physics.forces.servo_wheel import D, S, T, roll_wheel
from rover_physics.numerics.records import new_record

CREEP = 0.01
ways = st.floats(-1.5, 1.5)
spins = st.floats(-0.05, 0.05)
grips = st.floats(1e-3, 0.5)
droops = st.floats(0.0, 0.9)
limits = st.floats(0.02, 0.5)
many = settings(max_examples=300, deadline=None)


def roll(grip, velocity, droop=0.3, limit=0.2, full=0.2):
    """Return the SERVO of one wheel that is commanded to roll at the nominal speed."""
    servo = new_record(SERVO, droop=droop, full_traction=full, max_traction=limit, creep=CREEP)
    servo.command[0] = 1.0
    roll_wheel(servo, 0, grip, velocity)
    return servo


def expected(grip, velocity, droop, limit, full=0.2) -> np.ndarray:
    """Return T, S, D by bisection."""
    along, across, spin = velocity
    wide = np.hypot(across, CREEP)

    def forces(slip):
        ends = np.array([slip + spin, slip - spin])
        size = np.hypot(ends, wide)
        pulls = -0.5 * grip * ends / size
        return np.array([pulls.sum(), -0.5 * grip * across * (1 / size).sum(), -np.diff(pulls)[0]])

    def excess(slip):
        return slip - (along - 1.0) - droop / full * forces(slip)[T]

    slip = brentq(excess, -10.0, 10.0, xtol=1e-15)
    if abs(forces(slip)[T]) > limit:
        most = np.copysign(limit, forces(slip)[T])
        slip = brentq(lambda s: forces(s)[T] - most, -1e4, 1e4, xtol=1e-15)
    return forces(slip)


@many
@given(grips, ways, ways, spins, droops, limits)
def test_forces_are_those_of_servo_and_friction_law(grip, along, across, spin, droop, limit):
    servo = roll(grip, (along, across, spin), droop, limit)
    if abs(limit - grip) < 1e-3 * grip:
        return  # all friction is needed along the wheel: the slip is unbounded
    np.testing.assert_allclose(
        servo.force[0], expected(grip, (along, across, spin), droop, limit), atol=1e-7
    )


@many
@given(grips, ways, ways, spins, droops, limits)
@example(0.46875, 1.125, 0.8125, 0.0234375, 0.25, 0.5)  # the servo's own rest moves differences
def test_rates_are_the_differences_of_the_forces(grip, along, across, spin, droop, limit):
    at = np.array([along, across, spin, grip])
    servo = roll(grip, (along, across, spin), droop, limit)
    rates, found = servo.force_rate[0].copy(), np.empty((3, 4))
    if abs(abs(servo.force[0, T]) - limit) < 1e-4 or abs(limit - grip) < 0.02:
        return  # the forces have a kink where the torque limit begins
    step = 1e-6
    for k in range(4):
        ends = []
        for sign in (1.0, -1.0):
            moved = at + sign * step * np.eye(4)[k]
            ends.append(expected(moved[3], tuple(moved[:3]), droop, limit))
        found[:, k] = (ends[0] - ends[1]) / (2.0 * step)
    if abs(abs(servo.force[0, T]) - limit) < 1e-9:
        rates[T] = found[T] = 0.0
    np.testing.assert_allclose(rates, found, atol=2e-4 * max(1.0, np.abs(found).max()))


@pytest.mark.parametrize("velocity", [(0.5, 0.0, 0.0), (1.5, 0.3, 0.01), (0.9, -0.2, -0.02)])
def test_no_force_exceeds_the_friction_or_the_torque_limit(velocity):
    for limit in (0.02, 0.05, 0.3):
        force = roll(0.1, velocity, limit=limit).force[0]
        assert np.hypot(force[T], force[S]) <= 0.1 + 1e-9
        assert abs(force[T]) <= limit + 1e-12


def test_a_wheel_that_has_to_go_farther_is_dragged_and_one_that_lags_pushes():
    assert roll(0.1, (1.2, 0.0, 0.0)).force[0, T] < 0.0
    assert roll(0.1, (0.8, 0.0, 0.0)).force[0, T] > 0.0
    assert roll(0.1, (1.0, 0.0, 0.0)).force[0, T] == 0.0


def test_at_full_torque_the_servo_loses_its_droop():
    servo = roll(10.0, (0.7, 0.0, 0.0), droop=0.3, limit=0.5, full=0.2)
    assert servo.force[0, T] == pytest.approx(0.2, rel=1e-2)


def test_a_turning_wheel_scrubs_against_the_turn():
    turning = roll(0.1, (1.0, 0.0, 0.02)).force[0]
    assert turning[D] * 0.02 < 0.0
    assert turning[D] == pytest.approx(-0.1 * 2.0 / np.sqrt(5.0), rel=1e-6)
    assert turning[T] == pytest.approx(0.0, abs=1e-12)


def test_a_wheel_without_load_has_no_force():
    servo = roll(-0.1, (0.5, 0.2, 0.01))
    assert not servo.force[0].any() and not servo.force_rate[0].any()
